"""Records made for the studies: sound and spoilt ones, with one place or several, without modes, and modes tracked over years."""
