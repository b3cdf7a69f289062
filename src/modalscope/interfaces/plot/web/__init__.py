"""What a browser draws of results: arrays as blobs for the front end of the page, the report and the notebook."""
