// The C entry points of a compiled peer: states in, torques out, and a timing loop.
#pragma once

#include <chrono>

#include "closure.hpp"

/// `Engine(constants, model_path)` and `engine.torques(sample, tau)` become a shared library.
/// `peer_time` gives seconds for `count` evaluations over the samples in turn. With `dependent`,
/// each takes an input that waits for the torques of the one before: latency, not throughput.
#define PEER_EXPORT extern "C" __attribute__((visibility("default")))
#define PEER_ENTRY(Engine)                                                                        \
  PEER_EXPORT void* peer_new(const double* constants, const char* path) {                          \
    return new Engine(constants, path);                                                           \
  }                                                                                               \
  PEER_EXPORT void peer_free(void* engine) { delete static_cast<Engine*>(engine); }                \
  PEER_EXPORT void peer_solve(void* engine, const peer::Sample* samples, long n, double* tau) {    \
    for (long i = 0; i < n; ++i) static_cast<Engine*>(engine)->torques(samples[i], tau + 6 * i);  \
  }                                                                                               \
  PEER_EXPORT double peer_time(void* engine, const peer::Sample* samples, long n, long count,      \
                              int dependent) {                                                    \
    return peer::seconds(*static_cast<Engine*>(engine), samples, n, count, dependent);            \
  }

namespace peer {

template <class Engine>
double seconds(Engine& engine, const Sample* samples, long n, long count, bool dependent) {
  double tau[kChains] = {};
  const auto start = std::chrono::steady_clock::now();
  if (dependent) {
    for (long i = 0, k = 0; i < count; ++i, k = k + 1 == n ? 0 : k + 1) {
      Sample s = samples[k];
      s.q[0] += 0.0 * tau[0];  // waits for tau; not foldable, as it may be nan or signed
      engine.torques(s, tau);
    }
  } else {
    for (long i = 0, k = 0; i < count; ++i, k = k + 1 == n ? 0 : k + 1) {
      engine.torques(samples[k], tau);
      asm volatile("" : : "r"(tau) : "memory");
    }
  }
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  asm volatile("" : : "r"(tau) : "memory");
  return elapsed.count();
}

}  // namespace peer
