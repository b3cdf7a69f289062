"""The table of methods: data in, identification out."""
