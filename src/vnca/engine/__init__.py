"""Steps of the automaton: active cells, mask, stencil, and one folder a backend."""
