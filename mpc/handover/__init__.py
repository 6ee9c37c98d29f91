"""Handing weights over while driving: when a learnt tire is fit to steer with, and how gently."""
