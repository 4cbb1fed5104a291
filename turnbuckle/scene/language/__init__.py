"""The description language of 1994 (Displacement, 5.2 and Appendix A): text to definitions and back, without loss."""
