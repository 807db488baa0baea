"""The terms training minimises, one file a term."""
