"""Makes and checks what is published in results/published. Start it with scripts/published; __main__.py is the place to read first."""
