"""Training of the optical flow network, on synthetic motion; see `docs/flow.md`."""
