"""Makes and checks results/published; started by scripts/published, from __main__.py."""
