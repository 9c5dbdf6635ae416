//! Speed of every block, from single equations to steps of a batch, in walkers per second.
//!
//! `cargo bench`, or `cargo bench -- contact` for what has "contact" in its name. Equations run over blocks of one walker and
//! of [`walk::LANES`] walkers: what vector code gains is the ratio of the two.

mod batch;
mod blocks;
mod closed_loop;
mod human;
mod walk;

criterion::criterion_group!(benches, blocks::all, human::all, closed_loop::all, batch::all);
criterion::criterion_main!(benches);
