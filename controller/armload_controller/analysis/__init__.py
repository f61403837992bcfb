"""Operations on a configured arm and its files, without a bus: identify, validate, watch, design an excitation."""
