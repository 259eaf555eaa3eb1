// Kernels of semi-Markov chains: filter, smoother and Viterbi over labels and where they began.
//
// A state is a label together with the step at which it was entered. States older than the last edge of
// the rates are all left at the same rate, so they share one state per label, which is exact.

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_semi_markov.hpp"

namespace {

using pgm::Array;
using std::int64_t;
using pgm::semi_markov::ConstMatrix;
using pgm::semi_markov::ConstRow;
using pgm::semi_markov::Matrix;
using pgm::semi_markov::Rates;
using pgm::semi_markov::Row;
using pgm::semi_markov::States;

constexpr double INF = std::numeric_limits<double>::infinity();
constexpr double SMALLEST_TOTAL = 1e-280;   // below, scaled products have lost digits: that step is done
                                            // in logarithms
constexpr double SMALLEST_MASS = 1e-300;    // of a label that an observation can bring back: less counts
                                            // as ruled out
constexpr double LARGEST_EXPONENT = 700.0;  // of an exponential that is still a float
constexpr double LARGEST_WORTH = 1e290;     // of a state that observations before it had all but excluded

// The shares that stay and that leave over a stretch.
struct Shares {
    explicit Shares(double integral)
        : leaves(-std::expm1(-integral)), stays(leaves < 0.5 ? 1.0 - leaves : std::exp(-integral)) {}
    double leaves, stays;
};

// What moves between two steps: (K,) what left each label, what entered it, and all that it holds.
struct Flow {
    Row left, entered, held;
    auto fields() { return std::tie(left, entered, held); }
};

// Move the masses of step t - 1, times a `factor` (K,) by label, on to step t, and write the `flow`.
//
// Returns the first step whose entries are recent at t.
int64_t pass_on_states(Rates model, States states, int64_t t, int64_t low, ConstRow factor, Flow flow) {
    const auto &[at_m, recent, old] = states;
    const int64_t n_labels = model.n_labels();
    const double moved = at_m(t) - at_m(t - 1), limit = model.edges_m(model.n_rates() - 1);
    for (int64_t k = 0; k < n_labels; ++k) {
        const Shares share(model.last_rate(k) * moved);
        flow.left(k) = old(k) * factor(k) * share.leaves;
        flow.entered(k) = flow.held(k) = 0.0;
        old(k) *= factor(k) * share.stays;
    }
    int64_t before = 0, after = 0, next_low = low;
    for (int64_t s = t - 1; s >= low; --s) {
        const double age = at_m(t - 1) - at_m(s), aged = at_m(t) - at_m(s);
        before = model.bin_of(age, before);
        after = model.bin_of(aged, std::max(before, after));
        for (int64_t k = 0; k < n_labels; ++k) {
            const double mass = recent(s, k) * factor(k);
            const Shares share(model.over(k, before, age, after, aged));
            flow.left(k) += mass * share.leaves;
            if (aged >= limit) {
                old(k) += mass * share.stays;
            } else {
                recent(s, k) = mass * share.stays;
                flow.held(k) += mass * share.stays;
            }
        }
        if (aged >= limit) next_low = std::max(next_low, s + 1);
    }
    for (int64_t k = 0; k < n_labels; ++k) {
        for (int64_t m = 0; m < n_labels; ++m) flow.entered(k) += flow.left(m) * model.leaving(m, k);
        recent(t, k) = flow.entered(k);
        flow.held(k) += old(k) + flow.entered(k);
    }
    return next_low;
}

// Write the factor (K,) that each label's mass is to be multiplied by after an observation.
//
// Returns the total that it divides by and the logarithm of its scale; total 0 where the observation is
// impossible, which is then left out.
std::pair<double, double> weigh(const double *held, const double *log_likelihood, double *factor,
                                int64_t n_labels) {
    double scale = log_likelihood[0], total = 0.0;
    for (int64_t k = 1; k < n_labels; ++k) scale = std::max(scale, log_likelihood[k]);
    if (scale > -INF)
        for (int64_t k = 0; k < n_labels; ++k) {
            factor[k] = std::exp(log_likelihood[k] - scale);
            total += held[k] * factor[k];
        }
    if (total < SMALLEST_TOTAL) {
        scale = -INF;
        total = 0.0;
        for (int64_t k = 0; k < n_labels; ++k)
            if (held[k] > SMALLEST_MASS) scale = std::max(scale, std::log(held[k]) + log_likelihood[k]);
        if (scale > -INF)
            for (int64_t k = 0; k < n_labels; ++k) {
                factor[k] = std::exp(std::min(log_likelihood[k] - scale, LARGEST_EXPONENT));
                total += held[k] * factor[k];
            }
        else
            scale = 0.0;
    }
    double divisor = total;
    if (total == 0.0)
        for (int64_t k = 0; k < n_labels; ++k) {
            factor[k] = 1.0;
            divisor += held[k];
        }
    for (int64_t k = 0; k < n_labels; ++k) factor[k] /= divisor;
    return {total, scale};
}

// The total that the factor divides by: 0 where the observation is impossible.
double weigh_states(ConstRow held, ConstRow log_likelihood, Row factor) {
    return weigh(held.data(), log_likelihood.data(), factor.data(), factor.size()).first;
}

struct Found {  // see semi_markov.py
    Matrix beliefs, factor, left, entered;
    Array<int64_t, 1> low;
    Row total, scale;
    auto fields() { return std::tie(beliefs, factor, left, entered, low, total, scale); }
};

// Filter a whole chain, which begins with every label just entered.
void filter_stretches(ConstRow start, Rates model, States states, ConstMatrix log_likelihood,
                      Found found) {
    const int64_t n_steps = log_likelihood.shape(0), n_labels = log_likelihood.shape(1);
    std::vector<double> holding(start.begin(), start.end());
    const Row held(holding.data(), {n_labels});
    std::fill(states.old.begin(), states.old.end(), 0.0);
    std::copy(start.begin(), start.end(), &states.recent(0, 0));
    int64_t low = 0;
    for (int64_t t = 0; t < n_steps; ++t) {
        if (t > 0)
            low = pass_on_states(model, states, t, low, found.factor[t - 1],
                                 {found.left[t - 1], found.entered[t], held});
        found.low(t) = low;
        std::tie(found.total(t), found.scale(t)) =
            weigh(held.data(), &log_likelihood(t, 0), &found.factor(t, 0), n_labels);
        for (int64_t k = 0; k < n_labels; ++k) found.beliefs(t, k) = held(k) * found.factor(t, k);
    }
}

// Turn filtered beliefs into smoothed ones, in place, from the last step back.
//
// A label's belief at a step is that at the next, and who left it between them, less who entered it (Yu
// and Kobayashi 2003); `states` are used for the worth of each: how probable the rest of the
// observations is from there, over that from all.
void smooth_stretches(Rates model, States states, Found found) {
    const auto &[at_m, recent, old] = states;
    const auto &beliefs = found.beliefs, &factor = found.factor;
    const int64_t n_steps = beliefs.shape(0), n_labels = beliefs.shape(1);
    std::vector<double> entering(n_labels), leaving(n_labels);
    std::fill(recent.begin(), recent.end(), 1.0);
    std::fill(old.begin(), old.end(), 1.0);
    for (int64_t t = n_steps - 2; t >= 0; --t) {
        const double moved = at_m(t + 1) - at_m(t);
        for (int64_t k = 0; k < n_labels; ++k)
            entering[k] = std::min(factor(t + 1, k) * recent(t + 1, k), LARGEST_WORTH);
        double mass = 0.0;
        for (int64_t k = 0; k < n_labels; ++k) {
            leaving[k] = 0.0;
            for (int64_t m = 0; m < n_labels; ++m) leaving[k] += model.leaving(k, m) * entering[m];
            double belief = 0.0;
            if (beliefs(t, k) > 0.0) {
                const double came = found.entered(t + 1, k) * entering[k];
                const double went = found.left(t, k) * leaving[k];
                belief = std::max(beliefs(t + 1, k) + went - came, 0.0);
            }
            beliefs(t, k) = belief;
            mass += belief;
        }
        for (int64_t k = 0; k < n_labels; ++k) beliefs(t, k) /= mass;
        int64_t before = 0, after = 0;
        for (int64_t s = t; s >= found.low(t); --s) {
            const double age = at_m(t) - at_m(s), aged = at_m(t + 1) - at_m(s);
            before = model.bin_of(age, before);
            after = model.bin_of(aged, std::max(before, after));
            for (int64_t k = 0; k < n_labels; ++k) {
                const Shares share(model.over(k, before, age, after, aged));
                double worth = s >= found.low(t + 1) ? recent(s, k) : old(k);
                worth = share.stays * factor(t + 1, k) * worth + share.leaves * leaving[k];
                recent(s, k) = std::min(worth, LARGEST_WORTH);
            }
        }
        for (int64_t k = 0; k < n_labels; ++k) {
            const Shares share(model.last_rate(k) * moved);
            const double worth =
                share.stays * factor(t + 1, k) * old(k) + share.leaves * leaving[k];
            old(k) = std::min(worth, LARGEST_WORTH);
        }
    }
}

struct Origins {  // see semi_markov.py
    Array<int64_t, 2> began;
    Array<std::int16_t, 2> label;
    auto fields() { return std::tie(began, label); }
};

// Write the labels of the best path, from its last stretch back.
void trace(const States &states, const std::vector<double> &offset, int64_t low,
           const std::vector<int64_t> &old_began, const Origins &origins,
           const Array<int64_t, 1> &out) {
    const int64_t n_steps = states.recent.shape(0), n_labels = states.recent.shape(1);
    double best = -INF;
    int64_t label = 0, began = 0;
    for (int64_t k = 0; k < n_labels; ++k) {
        if (states.old(k) + offset[k] > best) {
            best = states.old(k) + offset[k];
            label = k;
            began = old_began[k];
        }
        for (int64_t s = low; s < n_steps; ++s)
            if (states.recent(s, k) + offset[k] > best) {
                best = states.recent(s, k) + offset[k];
                label = k;
                began = s;
            }
    }
    for (int64_t end = n_steps;;) {
        std::fill(out.begin() + began, out.begin() + end, label);
        if (began == 0) return;
        end = began;
        label = origins.label(began, label);
        began = origins.began(began - 1, label);
    }
}

// Write the most probable labels (T,) and return the logarithm of their joint probability.
//
// An impossible observation is marked and left out.
double best_stretches(ConstRow log_start, ConstMatrix log_leaving, Rates model, States states,
                      ConstMatrix log_likelihood, Origins origins, Array<int64_t, 1> out,
                      Array<bool, 1> impossible) {
    const auto &[at_m, recent, old] = states;
    const int64_t n_steps = log_likelihood.shape(0), n_labels = log_likelihood.shape(1);
    const double limit = model.edges_m(model.n_rates() - 1);
    std::fill(old.begin(), old.end(), -INF);
    std::copy(log_start.begin(), log_start.end(), &recent(0, 0));
    std::vector<int64_t> old_began(n_labels);
    std::vector<double> best_leaving(n_labels), offset(n_labels);
    std::vector<double> held(log_start.begin(), log_start.end());
    int64_t low = 0;
    double shift = 0.0;
    for (int64_t t = 0; t < n_steps; ++t) {
        if (t > 0) {
            const double moved = at_m(t) - at_m(t - 1);
            for (int64_t k = 0; k < n_labels; ++k) {
                const double through = model.last_rate(k) * moved;
                best_leaving[k] = old(k) + offset[k] + std::log(-std::expm1(-through));
                origins.began(t - 1, k) = old_began[k];
                old(k) += offset[k] - through;
                held[k] = old(k);
            }
            int64_t before = 0, after = 0, next_low = low;
            for (int64_t s = t - 1; s >= low; --s) {
                const double age = at_m(t - 1) - at_m(s), aged = at_m(t) - at_m(s);
                before = model.bin_of(age, before);
                after = model.bin_of(aged, std::max(before, after));
                for (int64_t k = 0; k < n_labels; ++k) {
                    const double through = model.over(k, before, age, after, aged);
                    const double here = recent(s, k) + offset[k];
                    const double leaves = here + std::log(-std::expm1(-through));
                    if (leaves > best_leaving[k]) {
                        best_leaving[k] = leaves;
                        origins.began(t - 1, k) = s;
                    }
                    const double stays = here - through;
                    held[k] = std::max(held[k], stays);
                    recent(s, k) = stays;
                    if (aged >= limit && stays > old(k)) {
                        old(k) = stays;
                        old_began[k] = s;
                    }
                }
                if (aged >= limit) next_low = std::max(next_low, s + 1);
            }
            low = next_low;
            for (int64_t k = 0; k < n_labels; ++k) {
                recent(t, k) = -INF;
                for (int64_t m = 0; m < n_labels; ++m) {
                    const double through = best_leaving[m] + log_leaving(m, k);
                    if (through > recent(t, k)) {
                        recent(t, k) = through;
                        origins.label(t, k) = static_cast<std::int16_t>(m);
                    }
                }
                held[k] = std::max(held[k], recent(t, k));
            }
        }
        double most = -INF;
        for (int64_t k = 0; k < n_labels; ++k) {
            offset[k] = log_likelihood(t, k);
            most = std::max(most, held[k] + offset[k]);
        }
        if (most == -INF) {
            impossible(t) = true;
            for (int64_t k = 0; k < n_labels; ++k) {
                offset[k] = 0.0;
                most = std::max(most, held[k]);
            }
        }
        for (int64_t k = 0; k < n_labels; ++k) offset[k] -= most;
        shift += most;
    }
    trace(states, offset, low, old_began, origins, out);
    return shift;
}

}  // namespace

PGM_KERNELS(module) {
    module.add("pass_on_states", pass_on_states, "model"_a, "states"_a, "t"_a, "low"_a, "factor"_a,
               "flow"_a);
    module.add("weigh_states", weigh_states, "held"_a, "log_likelihood"_a, "factor"_a);
    module.add("filter_stretches", filter_stretches, "start"_a, "model"_a, "states"_a,
               "log_likelihood"_a, "found"_a);
    module.add("smooth_stretches", smooth_stretches, "model"_a, "states"_a, "found"_a);
    module.add("best_stretches", best_stretches, "log_start"_a, "log_leaving"_a, "model"_a,
               "states"_a, "log_likelihood"_a, "origins"_a, "out"_a, "impossible"_a);
}
