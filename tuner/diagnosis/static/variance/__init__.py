"""Distribution and local variance of the residuals: histogram, modulation, quantization, share of white noise."""
