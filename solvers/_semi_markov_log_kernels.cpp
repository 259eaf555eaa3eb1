// Filter and smoother of semi-Markov chains with every sum in logarithms: slower, and nothing vanishes.
//
// States are those of the other kernels: a label and the step at which it was entered, and one more per
// label for those entered longer ago than the last edge of the rates.

#include <cmath>
#include <limits>
#include <vector>

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_semi_markov.hpp"

namespace {

using pgm::Array;
using pgm::semi_markov::ConstMatrix;
using pgm::semi_markov::ConstRow;
using pgm::semi_markov::Matrix;
using pgm::semi_markov::Rates;
using pgm::semi_markov::States;
using std::int64_t;

constexpr double INF = std::numeric_limits<double>::infinity();

// The logarithm of a sum of two, from their logarithms.
double log_add(double one, double other) {
    const double most = std::max(one, other);
    if (most == -INF) return most;
    return most + std::log1p(std::exp(std::min(one, other) - most));
}

// The logarithm of the share that leaves over a stretch.
double log_leaves(double integral) { return std::log(-std::expm1(-integral)); }

struct LogFound {  // see semi_markov.py
    Matrix beliefs, factor, entered, old;
    Array<int64_t, 1> low;
    Array<bool, 1> impossible;
    auto fields() { return std::tie(beliefs, factor, entered, old, low, impossible); }
};

// Filter a whole chain; the log-probability of all that is seen.
//
// Impossible observations are marked and left out.
double filter_stretches_in_logs(ConstRow log_start, ConstMatrix log_leaving, Rates model, States states,
                                ConstMatrix log_likelihood, LogFound found) {
    const auto &[at_m, recent, old] = states;
    const int64_t n_steps = log_likelihood.shape(0), n_labels = log_likelihood.shape(1);
    const double limit = model.edges_m(model.n_rates() - 1);
    std::fill(old.begin(), old.end(), -INF);
    std::vector<double> held(log_start.begin(), log_start.end()), left(n_labels);
    int64_t low = 0;
    double evidence = 0.0;
    for (int64_t t = 0; t < n_steps; ++t) {
        if (t == 0) {
            for (int64_t k = 0; k < n_labels; ++k) found.entered(0, k) = log_start(k);
        } else {
            const double moved = at_m(t) - at_m(t - 1);
            for (int64_t k = 0; k < n_labels; ++k) {
                const double through = model.last_rate(k) * moved;
                const double mass = old(k) + found.factor(t - 1, k);
                left[k] = mass + log_leaves(through);
                old(k) = mass - through;
                held[k] = -INF;
            }
            int64_t before = 0, after = 0, next_low = low;
            for (int64_t s = t - 1; s >= low; --s) {
                const double age = at_m(t - 1) - at_m(s), aged = at_m(t) - at_m(s);
                before = model.bin_of(age, before);
                after = model.bin_of(aged, std::max(before, after));
                for (int64_t k = 0; k < n_labels; ++k) {
                    const double through = model.over(k, before, age, after, aged);
                    const double mass = recent(s, k) + found.factor(t - 1, k);
                    left[k] = log_add(left[k], mass + log_leaves(through));
                    recent(s, k) = mass - through;
                    double &stays = aged >= limit ? old(k) : held[k];
                    stays = log_add(stays, recent(s, k));
                }
                if (aged >= limit) next_low = std::max(next_low, s + 1);
            }
            low = next_low;
            for (int64_t k = 0; k < n_labels; ++k) {
                double entered = -INF;
                for (int64_t m = 0; m < n_labels; ++m)
                    entered = log_add(entered, left[m] + log_leaving(m, k));
                found.entered(t, k) = entered;
                held[k] = log_add(held[k], log_add(old(k), entered));
            }
        }
        double gained = -INF, predicted = -INF;
        for (int64_t k = 0; k < n_labels; ++k) {
            recent(t, k) = found.entered(t, k);
            gained = log_add(gained, held[k] + log_likelihood(t, k));
            predicted = log_add(predicted, held[k]);
        }
        evidence += gained;
        found.low(t) = low;
        found.impossible(t) = gained == -INF;
        for (int64_t k = 0; k < n_labels; ++k) {
            const double weight = found.impossible(t) ? -predicted : log_likelihood(t, k) - gained;
            found.factor(t, k) = weight;
            found.old(t, k) = old(k) + weight;
            found.beliefs(t, k) = held[k] + weight;
        }
    }
    return evidence;
}

// Turn the logarithms of filtered beliefs into those of smoothed ones, in place, from the last step.
//
// A label's belief is the sum over its states of the mass and of the worth: how probable the rest of
// the observations is from there, over that from all. `states` are used for the worth.
void smooth_stretches_in_logs(ConstMatrix log_leaving, Rates model, States states, LogFound found) {
    const auto &[at_m, recent, old] = states;
    const int64_t n_steps = found.beliefs.shape(0), n_labels = found.beliefs.shape(1);
    std::vector<double> leaving(n_labels), weighed(n_labels), belief(n_labels);
    std::fill(recent.begin(), recent.end(), 0.0);
    std::fill(old.begin(), old.end(), 0.0);
    for (int64_t t = n_steps - 2; t >= 0; --t) {
        const double moved = at_m(t + 1) - at_m(t);
        for (int64_t k = 0; k < n_labels; ++k) {
            leaving[k] = -INF;
            for (int64_t m = 0; m < n_labels; ++m)
                leaving[k] = log_add(leaving[k], log_leaving(k, m) + found.factor(t + 1, m) +
                                                     recent(t + 1, m));
            weighed[k] = 0.0;
            belief[k] = -INF;
        }
        int64_t before = 0, after = 0;
        for (int64_t s = t; s >= found.low(t); --s) {
            const double age = at_m(t) - at_m(s), aged = at_m(t + 1) - at_m(s);
            before = model.bin_of(age, before);
            after = model.bin_of(aged, std::max(before, after));
            for (int64_t k = 0; k < n_labels; ++k) {
                weighed[k] += found.factor(s, k);
                const double through = model.over(k, before, age, after, aged);
                const double later = s >= found.low(t + 1) ? recent(s, k) : old(k);
                recent(s, k) = log_add(later + found.factor(t + 1, k) - through,
                                       leaving[k] + log_leaves(through));
                const double mass =
                    found.entered(s, k) + weighed[k] - model.integral(k, before, age);
                belief[k] = log_add(belief[k], mass + recent(s, k));
            }
        }
        double total = -INF;
        for (int64_t k = 0; k < n_labels; ++k) {
            const double through = model.last_rate(k) * moved;
            old(k) = log_add(old(k) + found.factor(t + 1, k) - through,
                             leaving[k] + log_leaves(through));
            belief[k] = log_add(belief[k], found.old(t, k) + old(k));
            total = log_add(total, belief[k]);
        }
        for (int64_t k = 0; k < n_labels; ++k) found.beliefs(t, k) = belief[k] - total;
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("filter_stretches_in_logs", filter_stretches_in_logs, "log_start"_a, "log_leaving"_a,
               "model"_a, "states"_a, "log_likelihood"_a, "found"_a);
    module.add("smooth_stretches_in_logs", smooth_stretches_in_logs, "log_leaving"_a, "model"_a,
               "states"_a, "found"_a);
}
