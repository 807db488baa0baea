"""OpenVDB files, read and written without OpenVDB."""
