"""What everything stands on: errors, boxes, volumes, cameras, colours, files."""
