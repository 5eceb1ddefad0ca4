// Compiles a function twice, for any x86-64 and for AVX2; the processor chooses at run time.
#pragma once

// Sanitizers instrument the resolver that runs before they are set up; their builds go without.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__) && \
    !defined(__SANITIZE_ADDRESS__)
#define SCATTER_VECTOR_CLONES [[gnu::target_clones("avx2", "default")]]
#else
#define SCATTER_VECTOR_CLONES
#endif
