"""Kicks and diffusions."""
