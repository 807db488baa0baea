"""What is seen at points between the cells of a state."""
