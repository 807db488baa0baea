"""The backend on NVIDIA GPUs."""
