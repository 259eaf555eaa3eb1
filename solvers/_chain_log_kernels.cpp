// Filter and smoother with every sum in logarithms: K^2 exponentials a step, and nothing vanishes.
//
// Tables are logarithms: `transition_t[a, l, m]` of coming to `l` from `m` under the action that led to a
// step, `leaving[a, m, l]` the same.

#include <cmath>
#include <limits>
#include <vector>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

constexpr double INF = std::numeric_limits<double>::infinity();

// The logarithm of the sum of products, from the factors' logarithms (K,) each.
double log_sum(const double *first, const double *second, int64_t n_labels) {
    double most = -INF;
    for (int64_t k = 0; k < n_labels; ++k) most = std::max(most, first[k] + second[k]);
    if (most == -INF) return most;
    double total = 0.0;
    for (int64_t k = 0; k < n_labels; ++k) total += std::exp(first[k] + second[k] - most);
    return most + std::log(total);
}

// Write the logarithms of filtered beliefs (T, K); the log-probability of all that is seen.
//
// Impossible observations are marked and left out.
double filter_in_logs(Array<const double, 1> start, Array<const double, 3> transition_t,
                      Array<const int64_t, 1> action, Array<const double, 2> log_likelihood,
                      Array<double, 2> out, Array<bool, 1> impossible) {
    const int64_t n_steps = log_likelihood.shape(0), n_labels = log_likelihood.shape(1);
    const std::vector<double> nothing(n_labels);
    double evidence = 0.0;
    for (int64_t t = 0; t < n_steps; ++t) {
        for (int64_t k = 0; k < n_labels; ++k)
            out(t, k) = t == 0 ? start(k)
                               : log_sum(&transition_t(action(t), k, 0), &out(t - 1, 0), n_labels);
        double gained = log_sum(&out(t, 0), &log_likelihood(t, 0), n_labels);
        evidence += gained;
        impossible(t) = gained == -INF;
        if (impossible(t)) {
            gained = log_sum(&out(t, 0), nothing.data(), n_labels);
            for (int64_t k = 0; k < n_labels; ++k) out(t, k) -= gained;
        } else {
            for (int64_t k = 0; k < n_labels; ++k) out(t, k) += log_likelihood(t, k) - gained;
        }
    }
    return evidence;
}

// Turn the logarithms of filtered beliefs (T, K) into those of smoothed ones, in place.
void smooth_in_logs(Array<const double, 3> transition_t, Array<const double, 3> leaving,
                    Array<const int64_t, 1> action, Array<double, 2> out) {
    const int64_t n_steps = out.shape(0), n_labels = out.shape(1);
    const std::vector<double> nothing(n_labels);
    std::vector<double> ratio(n_labels), back(n_labels);
    for (int64_t t = n_steps - 2; t >= 0; --t) {
        const int64_t a = action(t + 1);
        for (int64_t m = 0; m < n_labels; ++m) {
            ratio[m] = out(t + 1, m);
            if (ratio[m] > -INF) ratio[m] -= log_sum(&transition_t(a, m, 0), &out(t, 0), n_labels);
        }
        for (int64_t k = 0; k < n_labels; ++k)
            back[k] = log_sum(&leaving(a, k, 0), ratio.data(), n_labels);
        for (int64_t k = 0; k < n_labels; ++k) out(t, k) += back[k];
        const double total = log_sum(&out(t, 0), nothing.data(), n_labels);
        for (int64_t k = 0; k < n_labels; ++k) out(t, k) -= total;
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("filter_in_logs", filter_in_logs, "start"_a, "transition_t"_a, "action"_a,
               "log_likelihood"_a, "out"_a, "impossible"_a);
    module.add("smooth_in_logs", smooth_in_logs, "transition_t"_a, "leaving"_a, "action"_a, "out"_a);
}
