"""Training of knee policies with PPO from Stable-Baselines3."""
