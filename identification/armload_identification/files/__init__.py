"""Files of results: payload, body, gains; read strictly, written atomically."""
