"""Pure mathematics of inertial noise, filters and motion: no files, no clock, no printing.

This page states the conventions of the whole project; nothing may contradict it.

Units
-----
SI inside, always: rad, s, m. Customary units (deg/h, deg/√h, µg, mGal, …) exist only in
`models.units`, in readers, exporters, reports and the command line. Time is float64 seconds.

Spectral densities
------------------
All densities are **two-sided**: white noise of density N (unit/√Hz) has the spectrum
S(f) = N², samples of variance N²/dt and the Allan variance N²/τ. A datasheet density d quoted
one-sided (σ² = d² · bandwidth) is N = d/√2 here.

Allan variance of a process with spectrum S::

    AVAR(τ) = 4 ∫_0^∞ S(f) sin⁴(πfτ) / (πfτ)² df

Samples
-------
A rate sample of white or quantization noise is an average over its interval; a slow process
(flicker, random walk, Gauss–Markov, sinusoid, ramp) is sampled at the instant. Functions that take
`interval` answer for such samples, aliasing included; without it they answer for the continuous process.

Terms (symbols of IEEE Std 952)
-------------------------------
======================  =======================  ==========================================
term                    parameter                Allan variance
======================  =======================  ==========================================
Quantization            Q, increment sd          3 Q²/τ²
White (ARW, VRW)        N, density               N²/τ
BiasInstability         B, level, S = B²/(2πf)   → (2 ln 2/π) B², σ = 0.664 B
RandomWalk (RRW)        K, density               K² τ/3
Ramp                    R, rate                  R² τ²/2
GaussMarkov             σ, sd; T, time constant  peak 0.617 σ at 1.89 T
======================  =======================  ==========================================

Frames
------
e Earth-centred Earth-fixed, i inertial, n north-east-down, b forward-right-down.
`vec_a` is a vector in frame a; `mat_ab` rotates a vector of b into a.

Words
-----
`density`, `variance`, `sd` and `time_constant` are four different things. Matrices carry the letters
of the books: F, G, H, P, Q, R, Phi. Randomness enters only through an `rng: numpy.random.Generator`.

References
----------
.. [1] IEEE Std 952-1997, Annex C (symbols and Allan variance of the five terms).
.. [2] P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.
"""
