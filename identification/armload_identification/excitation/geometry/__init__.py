"""Where an arm is and how fast its points move: workspace, collision, reduced speed."""
