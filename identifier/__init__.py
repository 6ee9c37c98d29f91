"""What is learnt: network, adaptive laws, one step, and the frozen-weight test."""
