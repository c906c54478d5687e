"""Fast spectrum of a channel: binned periodogram, filters, ARMA colours, resonances, aliasing."""
