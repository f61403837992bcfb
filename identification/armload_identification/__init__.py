"""The mathematics: model, regressor, excitation, estimation, validation, report."""
