"""What the kernels, training and stylizing cost on the machine at hand."""
