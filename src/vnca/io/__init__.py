"""Files in and out: volumes, sequences, pictures and films."""
