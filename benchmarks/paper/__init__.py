"""The paper's tables; `make paper` runs all of it."""
