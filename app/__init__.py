"""Everything that touches a browser, a file or a socket."""
