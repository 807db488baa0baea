"""From one frame and one picture to a rule."""
