"""What a rule is trained on: smoke, or a block of solid texture."""
