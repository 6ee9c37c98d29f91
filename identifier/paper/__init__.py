"""The identifier of Hong and Choi: network, adaptive laws, step and design."""
