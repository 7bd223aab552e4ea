"""How good a segmenter's instances are: measured against the simulator's true masks."""
