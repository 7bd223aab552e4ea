"""The table of a run: means over scenes beside the seed's numbers, in four renderings."""
