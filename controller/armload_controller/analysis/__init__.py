"""What is done with a configured arm and files, without a bus: identify, validate, design an excitation."""
