"""The backend in numpy, for machines without torch and without the native core."""
