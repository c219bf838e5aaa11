// IMUD_DISPATCHED marks the definition of a function on the sample path: it is compiled twice, with all that it calls
// inline, for the baseline of x86-64 and for its AVX2 instructions, and the dynamic linker takes the better one that
// the processor has. The bits of the results are the same: nothing is contracted or reassociated
// (imud_options in the top CMakeLists.txt), and vector instructions round as scalar ones do.
//
// Sanitizers are not ready when the linker asks which one to take; an unoptimised build gains nothing.
#pragma once

#if defined(__x86_64__) && defined(__OPTIMIZE__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define IMUD_DISPATCHED [[gnu::flatten, gnu::target_clones("avx2", "default")]]
#else
#define IMUD_DISPATCHED
#endif
