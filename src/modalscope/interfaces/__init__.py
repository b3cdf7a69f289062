"""How people meet the program: pictures, written results, the page, commands."""
