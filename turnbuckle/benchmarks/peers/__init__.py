"""Other libraries on our scenes, each a script in a process of its own that prints one JSON object."""
