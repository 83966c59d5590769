// The C entry points of a compiled peer: states in, torques out, and a timing loop.
#pragma once

#include <chrono>
#include <exception>

#include "closure.hpp"

namespace peer {

/// Seconds for `count` evaluations over the samples in turn. With `dependent`, each takes an input
/// that waits for the torques of the one before: latency, not throughput.
template <class Engine>
double seconds(Engine& engine, const Sample* samples, long n, long count, bool dependent) {
  double tau[kChains] = {};
  const auto start = std::chrono::steady_clock::now();
  for (long i = 0, k = 0; i < count; ++i, k = k + 1 == n ? 0 : k + 1) {
    Sample s = samples[k];
    if (dependent) s.q[0] += 0.0 * tau[0];  // the compiler may not drop it: tau could be nan
    engine.torques(s, tau);
    asm volatile("" : : "r"(tau) : "memory");
  }
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  return elapsed.count();
}

template <class Engine>
void* start(const double* constants, const char* model_path) {
  try {
    return new Engine(constants, model_path);
  } catch (const std::exception&) {
    return nullptr;
  }
}

}  // namespace peer

#define PEER_EXPORT extern "C" __attribute__((visibility("default")))

/// `Engine(constants, model_path)` and `engine.torques(sample, tau)` as a shared library.
#define PEER_ENTRY(Engine)                                                                       \
  PEER_EXPORT void* peer_new(const double* constants, const char* model_path) {                  \
    return peer::start<Engine>(constants, model_path);                                           \
  }                                                                                              \
  PEER_EXPORT void peer_free(void* engine) { delete static_cast<Engine*>(engine); }              \
  PEER_EXPORT void peer_solve(void* engine, const peer::Sample* samples, long n, double* tau) {  \
    for (long i = 0; i < n; ++i) static_cast<Engine*>(engine)->torques(samples[i], tau + 6 * i); \
  }                                                                                              \
  PEER_EXPORT double peer_time(void* engine, const peer::Sample* samples, long n, long count,    \
                               int dependent) {                                                  \
    return peer::seconds(*static_cast<Engine*>(engine), samples, n, count, dependent != 0);      \
  }
