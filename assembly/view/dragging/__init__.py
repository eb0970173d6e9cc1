"""A scene that people drag with the mouse: the loop that follows them, and the page that shows it."""
