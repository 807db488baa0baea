"""One step of the cellular automaton."""
