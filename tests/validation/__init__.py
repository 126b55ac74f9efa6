"""The claims of the documentation measured against independent truths: `make validate`."""
