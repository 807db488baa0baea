"""The backend in C++, fused and vectorised, threaded."""
