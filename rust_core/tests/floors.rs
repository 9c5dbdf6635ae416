//! The floors of the crate: what a file may import. Reads the `use crate::` lines of the sources.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// From the ground up. A file imports from its own floor or from those below; rooms of one floor know nothing of each other.
const FLOORS: &[&[&str]] = &[
    &["numerics", "schema", "signals"],
    &["human", "mechanics", "prosthesis", "sensors"],
    &["plant"],
    &["closed_loop"],
    &["agent", "episode"],
    &["config"],
    &["validation"],
    &["trial", "vector"],
    &["python"],
];

/// Rooms of one floor that may import another one of it.
const BESIDE: &[(&str, &str)] = &[("schema", "numerics"), ("signals", "numerics")];

/// Lines of a file, at most.
const MOST_LINES: usize = 400;

/// Modules by path, such as `plant::state`, and what their files import.
type Imports = BTreeMap<String, BTreeSet<String>>;

fn sources() -> Vec<(String, String)> {
    fn visit(folder: &Path, files: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).expect("the crate's sources can be read") {
            let path = entry.expect("and each of them").path();
            if path.is_dir() {
                visit(&path, files);
            } else {
                files.push(path);
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    visit(&root, &mut files);
    let module = |path: &Path| {
        let relative = path.strip_prefix(&root).expect("files lie below").with_extension("");
        let parts: Vec<_> = relative.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        parts.join("::").trim_end_matches("::mod").to_owned()
    };
    let read = |path: &PathBuf| (module(path), fs::read_to_string(path).expect("sources are text"));
    files.iter().map(read).filter(|(module, _)| module != "lib").collect()
}

/// Code without comments and without its tests.
fn code(text: &str) -> String {
    let tested = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    let uncommented = tested.lines().map(|line| line.split("//").next().unwrap_or_default());
    uncommented.collect::<Vec<_>>().join("\n")
}

/// Every path of a tree such as `a::{b, c::{self, D}}`.
fn paths(tree: &str) -> Vec<String> {
    let tree = tree.trim();
    let Some((prefix, rest)) = tree.split_once('{') else { return vec![tree.to_owned()] };
    let inner = rest.trim_end().strip_suffix('}').expect("braces are closed");
    let (mut depth, mut start, mut parts) = (0, 0, Vec::new());
    for (at, character) in inner.char_indices() {
        match character {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&inner[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&inner[start..]);
    let parts = parts.into_iter().filter(|part| !part.trim().is_empty());
    parts.flat_map(|part| paths(&format!("{prefix}{}", part.trim()))).collect()
}

/// Paths that a module's code names, from the crate's root: in `use`, and in the text.
fn named(module: &str, code: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut rest = String::new();
    for statement in code.split_inclusive(';') {
        let words = statement.trim();
        let used = words.rfind("use ").filter(|at| !words[..*at].contains(['{', '=', '"'])).map(|at| &words[at + 4..]);
        match used {
            Some(tree) => found.extend(paths(tree.trim_end_matches(';'))),
            None => rest.push_str(statement),
        }
    }
    for part in rest.split("crate::").skip(1) {
        let end = part.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')).unwrap_or(part.len());
        found.push(format!("crate::{}", part[..end].trim_end_matches(':')));
    }
    let above = |path: &str| {
        let parent = module.rsplit_once("::").map_or("", |(parent, _)| parent);
        path.strip_prefix("super::").map(|rest| format!("{parent}::{rest}").trim_start_matches("::").to_owned())
    };
    let below = |path: &str| format!("{module}::{path}");
    found
        .into_iter()
        .map(|path| {
            path.strip_prefix("crate::").map(str::to_owned).or_else(|| above(&path)).unwrap_or_else(|| below(&path))
        })
        .collect()
}

fn imports() -> Imports {
    let sources = sources();
    let modules: BTreeSet<&str> = sources.iter().map(|(module, _)| module.as_str()).collect();
    let file_of = |path: &str| {
        let mut path = path;
        loop {
            if modules.contains(path) {
                return Some(path.to_owned());
            }
            path = path.rsplit_once("::")?.0;
        }
    };
    let of = |(module, text): &(String, String)| {
        let files = named(module, &code(text)).iter().filter_map(|path| file_of(path)).collect::<BTreeSet<_>>();
        (module.clone(), files.into_iter().filter(|file| file != module).collect())
    };
    sources.iter().map(of).collect()
}

fn room(module: &str) -> &str {
    module.split("::").next().unwrap_or_default()
}

/// A way from `from` back to itself.
fn circle(imports: &Imports, from: &str) -> Option<Vec<String>> {
    let mut ways = vec![vec![from.to_owned()]];
    let mut seen = BTreeSet::new();
    while let Some(way) = ways.pop() {
        for next in &imports[way.last()?] {
            if next == from {
                return Some(way);
            }
            if seen.insert(next.clone()) {
                ways.push(way.iter().chain([next]).cloned().collect());
            }
        }
    }
    None
}

/// Imports that the floors forbid, as `importer -> imported`.
fn forbidden(imports: &Imports) -> Vec<String> {
    let floor = |room: &str| FLOORS.iter().position(|rooms| rooms.contains(&room)).expect("every room has its floor");
    let mut found = Vec::new();
    for (importer, imported) in imports {
        for imported in imported {
            let (from, to) = (room(importer), room(imported));
            let beside = floor(from) == floor(to) && from != to && !BESIDE.contains(&(from, to));
            if beside || floor(to) > floor(from) {
                found.push(format!("{importer} -> {imported}"));
            }
        }
    }
    found
}

#[test]
fn no_file_imports_itself_by_way_of_others() {
    let imports = imports();
    let circles: Vec<_> = imports.keys().filter_map(|module| circle(&imports, module)).collect();
    assert!(circles.is_empty(), "{circles:#?}");
}

#[test]
fn nothing_imports_upwards_or_from_the_room_beside() {
    let found = forbidden(&imports());
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn files_stay_short() {
    let lines = sources().into_iter().map(|(module, text)| (text.lines().count(), module));
    let long: Vec<_> = lines.filter(|(lines, _)| *lines > MOST_LINES).collect();
    assert!(long.is_empty(), "{long:?}");
}

#[test]
fn circles_and_imports_upwards_are_found_where_there_are_some() {
    let code =
        code("use crate::plant::{self, state::State};\nfn f() { crate::human::drive::g() } // crate::vector::batch\n");
    let found = named("numerics::math", &code);
    assert_eq!(found, ["plant::self", "plant::state::State", "human::drive::g"]);
    assert_eq!(named("plant::flow", "use super::state::{Rest, State};"), ["plant::state::Rest", "plant::state::State"]);
    let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<_>>();
    let imports = Imports::from([
        ("human::a".to_owned(), set(&["human::b", "numerics::math"])),
        ("human::b".to_owned(), set(&["human::a", "plant::state"])),
        ("numerics::math".to_owned(), set(&[])),
        ("plant::state".to_owned(), set(&["human::a", "sensors"])),
        ("sensors".to_owned(), set(&["mechanics::walker"])),
        ("mechanics::walker".to_owned(), set(&[])),
    ]);
    assert!(circle(&imports, "human::a").is_some_and(|way| way.contains(&"human::b".to_owned())));
    assert!(circle(&imports, "human::b").is_some());
    assert_eq!(circle(&imports, "sensors"), None);
    assert_eq!(forbidden(&imports), ["human::b -> plant::state", "sensors -> mechanics::walker"]);
}
