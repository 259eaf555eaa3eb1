// Kernels of hidden Markov chains: the filter with scaled likelihoods, the smoother, Viterbi.
//
// They are compiled for each small number of labels K, so that a chain's numbers are carried from step
// to step in registers, and for any number (K = 0).
//
// Beliefs are carried without dividing by their sum, which is kept beside them, so that no step waits
// for a division; they are scaled up again before they become too small.

#include <array>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

constexpr double INF = std::numeric_limits<double>::infinity();
constexpr double SMALLEST_TOTAL = 1e-200;  // below, beliefs of 1e-108 lose digits: that step is done in
                                           // logarithms
constexpr double SMALL_TOTAL = 1e-100;     // below, what is carried is scaled up again
constexpr double LOW_SCORE = -1e3;  // of the best path: below, scores are counted from it anew, so that
                                    // digits remain

// Numbers of the labels.
template <int K> struct Numbers : std::array<double, K> {
    explicit Numbers(int64_t) : std::array<double, K>{} {}
};
template <> struct Numbers<0> : std::vector<double> {
    explicit Numbers(int64_t n_labels) : std::vector<double>(n_labels) {}
};

template <int K> int64_t number_of(int64_t n_labels) { return K > 0 ? K : n_labels; }

// Call a function with the number of labels as a constant, if it is small.
template <class Function> auto for_labels(int64_t n_labels, const Function &function) {
    switch (n_labels) {
        case 2: return function(std::integral_constant<int, 2>());
        case 3: return function(std::integral_constant<int, 3>());
        case 4: return function(std::integral_constant<int, 4>());
        case 5: return function(std::integral_constant<int, 5>());
        case 6: return function(std::integral_constant<int, 6>());
        case 8: return function(std::integral_constant<int, 8>());
        default: return function(std::integral_constant<int, 0>());
    }
}

// Rows (n, K) less their largest entry, which goes to `best`; all -inf stays so, best 0.
void subtract_best(Array<const double, 2> log_likelihood, Array<double, 2> out,
                   Array<double, 1> best) {
    const int64_t n_steps = log_likelihood.shape(0), n_labels = log_likelihood.shape(1);
    for (int64_t t = 0; t < n_steps; ++t) {
        double most = log_likelihood(t, 0);
        for (int64_t k = 1; k < n_labels; ++k) most = std::max(most, log_likelihood(t, k));
        most = most > -INF ? most : 0.0;
        best(t) = most;
        for (int64_t k = 0; k < n_labels; ++k) out(t, k) = log_likelihood(t, k) - most;
    }
}

// Multiply a prediction of any sum by a likelihood of any size, and divide it by its sum.
//
// The logarithm of that sum is returned: -inf where every product is 0, and the prediction is left as
// it was, but for its sum.
double weigh_in_logs(const double *log_likelihood, double *predicted, int64_t n_labels) {
    double most = -INF, total = 0.0;
    for (int64_t k = 0; k < n_labels; ++k)
        if (predicted[k] > 0.0) most = std::max(most, std::log(predicted[k]) + log_likelihood[k]);
    for (int64_t k = 0; k < n_labels; ++k) {
        if (predicted[k] > 0.0 && most > -INF)
            predicted[k] = std::exp(std::log(predicted[k]) + log_likelihood[k] - most);
        total += predicted[k];
    }
    for (int64_t k = 0; k < n_labels; ++k) predicted[k] /= total;
    return most + std::log(total);
}

struct Steps {  // see forward.py
    Array<const int64_t, 1> action;
    Array<const double, 2> log_likelihood, likelihood;
    Array<double, 1> scale;
    Array<double, 2> beliefs;
    Array<bool, 1> impossible;
    auto fields() {
        return std::tie(action, log_likelihood, likelihood, scale, beliefs, impossible);
    }
};

template <int K>
double filter(const Array<double, 1> &belief, bool begun, const Array<const double, 3> &transition_t,
              const Steps &steps) {
    const int64_t n_steps = steps.likelihood.shape(0), n_labels = number_of<K>(belief.shape(0));
    Numbers<K> carried(n_labels), predicted(n_labels);
    double mass = 0.0;
    for (int64_t k = 0; k < n_labels; ++k) {
        carried[k] = belief(k);
        mass += belief(k);
    }
    double evidence = -std::log(mass);
    for (int64_t t = 0; t < n_steps; ++t) {
        if (t > 0 || begun) {
            const double *from = transition_t.data() + steps.action(t) * n_labels * n_labels;
            for (int64_t k = 0; k < n_labels; ++k) {
                double arriving = from[k * n_labels] * carried[0];
                for (int64_t m = 1; m < n_labels; ++m) arriving += from[k * n_labels + m] * carried[m];
                predicted[k] = arriving;
            }
        } else {
            std::swap(carried, predicted);
        }
        const double *likelihood = steps.likelihood.data() + t * n_labels;
        mass = 0.0;
        for (int64_t k = 0; k < n_labels; ++k) {
            const double weighed = predicted[k] * likelihood[k];
            carried[k] = weighed;
            mass += weighed;
        }
        steps.impossible(t) = false;
        if (mass < SMALLEST_TOTAL) {
            carried = predicted;
            const double gained = weigh_in_logs(steps.log_likelihood.data() + t * n_labels,
                                                carried.data(), n_labels);
            steps.impossible(t) = gained == -INF;
            evidence += gained;
            steps.scale(t) = 0.0;
            mass = 1.0;
        } else if (mass < SMALL_TOTAL) {
            evidence += std::log(mass);
            for (int64_t k = 0; k < n_labels; ++k) carried[k] = carried[k] / mass;
            mass = 1.0;
        }
        const double factor = 1.0 / mass;
        double *out = steps.beliefs.data() + t * n_labels;
        for (int64_t k = 0; k < n_labels; ++k) out[k] = carried[k] * factor;
    }
    for (int64_t k = 0; k < n_labels; ++k) belief(k) = carried[k];
    return evidence + std::log(mass);
}

// Filter some steps on from `belief` (K,), of any sum, left at the last (paper eq. 3).
//
// `transition_t[a, l, m]` is the probability of coming to `l` from `m` under the action that led to the
// step; before anything has `begun` the belief is the first step's prediction. Impossible observations
// are left out. Returns the logarithm of the probability of all that is seen, without what is in
// `scale`: that of the products carried, which needs no logarithm per step.
double filter_chain(Array<double, 1> belief, bool begun, Array<const double, 3> transition_t, Steps steps) {
    return for_labels(belief.shape(0), [&](auto labels) {
        return filter<labels()>(belief, begun, transition_t, steps);
    });
}

// The sum of a step's smoothed belief, which is written to `earlier`, not divided.
//
// Ratios of the `later` belief and its prediction are all multiplied by `least`.
template <int K>
double one_back(const double *from, const double *filtered, const Numbers<K> &later,
                const Numbers<K> &predicted, double least, Numbers<K> &earlier, Numbers<K> &ratio,
                int64_t n_labels) {
    double mass = 0.0;
    for (int64_t m = 0; m < n_labels; ++m) ratio[m] = later[m] * (least / predicted[m]);
    for (int64_t k = 0; k < n_labels; ++k) {
        double back = from[k] * ratio[0];
        for (int64_t m = 1; m < n_labels; ++m) back += from[m * n_labels + k] * ratio[m];
        const double weighed = filtered[k] * back;
        earlier[k] = weighed;
        mass += weighed;
    }
    return mass;
}

template <int K>
void smooth(const Array<const double, 3> &transition_t, const Array<const int64_t, 1> &action,
            const Array<double, 2> &beliefs) {
    const int64_t n_steps = beliefs.shape(0), n_labels = number_of<K>(beliefs.shape(1));
    Numbers<K> later(n_labels), earlier(n_labels), predicted(n_labels), ratio(n_labels);
    for (int64_t k = 0; k < n_labels; ++k) later[k] = n_steps > 0 ? beliefs(n_steps - 1, k) : 0.0;
    double before = 1.0;  // the sum of `later`
    for (int64_t t = n_steps - 2; t >= 0; --t) {
        const double *from = transition_t.data() + action(t + 1) * n_labels * n_labels;
        double *filtered = beliefs.data() + t * n_labels;
        double least = INF;
        for (int64_t m = 0; m < n_labels; ++m) {
            double coming = from[m * n_labels] * filtered[0];
            for (int64_t k = 1; k < n_labels; ++k) coming += from[m * n_labels + k] * filtered[k];
            coming = coming > 0.0 ? coming : 1.0;  // its label is ruled out: its ratio is 0
            predicted[m] = coming;
            least = coming < least ? coming : least;
        }
        double mass = one_back(from, filtered, later, predicted, least, earlier, ratio, n_labels);
        if (mass < SMALL_TOTAL) {
            // Again, with a scale that labels do not count for that are ruled out.
            least = INF;
            for (int64_t m = 0; m < n_labels; ++m) {
                later[m] = later[m] / before;
                if (later[m] > 0.0 && predicted[m] < least) least = predicted[m];
            }
            mass = one_back(from, filtered, later, predicted, least, earlier, ratio, n_labels);
            for (int64_t k = 0; k < n_labels; ++k) earlier[k] = earlier[k] / mass;
            mass = 1.0;
        }
        const double factor = 1.0 / mass;
        for (int64_t k = 0; k < n_labels; ++k) filtered[k] = earlier[k] * factor;
        std::swap(later, earlier);
        before = mass;
    }
}

// Turn filtered beliefs (T, K) into smoothed ones, in place, from the last step back.
//
// `p(l_t | all) = f_t(l) sum_m P(m | l) p(m_{t+1} | all) / predicted_{t+1}(m)`; `action[t]` led to step
// `t`.
void smooth_chain(Array<const double, 3> transition_t, Array<const int64_t, 1> action,
                  Array<double, 2> beliefs) {
    for_labels(beliefs.shape(1), [&](auto labels) { smooth<labels()>(transition_t, action, beliefs); });
}

template <int K, class T>
double best_paths(const Array<double, 1> &best_score, bool begun,
                  const Array<const double, 3> &log_transition_t, const Array<const int64_t, 1> &action,
                  const Array<const double, 2> &log_likelihood, const Array<T, 2> &origin,
                  const Array<bool, 1> &impossible) {
    const int64_t n_steps = log_likelihood.shape(0), n_labels = number_of<K>(best_score.shape(0));
    Numbers<K> reach(n_labels), arrive(n_labels);
    for (int64_t k = 0; k < n_labels; ++k) reach[k] = best_score(k);
    double shift = 0.0;
    for (int64_t t = 0; t < n_steps; ++t) {
        if (t > 0 || begun) {
            const double *from = log_transition_t.data() + action(t) * n_labels * n_labels;
            T *__restrict came = origin.data() + t * n_labels;
            for (int64_t k = 0; k < n_labels; ++k) {
                double best = reach[0] + from[k * n_labels];
                int best_from = 0;
                for (int m = 1; m < n_labels; ++m) {
                    const double through = reach[m] + from[k * n_labels + m];
                    best_from = through > best ? m : best_from;
                    best = through > best ? through : best;
                }
                arrive[k] = best;
                came[k] = static_cast<T>(best_from);
            }
        } else {
            std::swap(arrive, reach);
        }
        const double *observed = log_likelihood.data() + t * n_labels;
        double most = -INF;
        for (int64_t k = 0; k < n_labels; ++k) {
            const double reached = arrive[k] + observed[k];
            reach[k] = reached;
            most = reached > most ? reached : most;
        }
        impossible(t) = most == -INF;
        if (most == -INF) {
            for (int64_t k = 0; k < n_labels; ++k) {
                reach[k] = arrive[k];
                most = std::max(most, reach[k]);
            }
        }
        if (most < LOW_SCORE) {
            for (int64_t k = 0; k < n_labels; ++k) reach[k] = reach[k] - most;
            shift += most;
        }
    }
    for (int64_t k = 0; k < n_labels; ++k) best_score(k) = reach[k];
    return shift;
}

// Go on by some steps from the score (K,) of the best path to each label, left at the last.
//
// Before anything has `begun` the scores are those of the first labels. `origin` (n, K) is the best
// label before each. An impossible observation is marked and left out. Returns what was taken off all
// scores.
template <class T>
double viterbi_chain(Array<double, 1> best_score, bool begun, Array<const double, 3> log_transition_t,
                     Array<const int64_t, 1> action, Array<const double, 2> log_likelihood,
                     Array<T, 2> origin, Array<bool, 1> impossible) {
    return for_labels(best_score.shape(0), [&](auto labels) {
        return best_paths<labels()>(best_score, begun, log_transition_t, action, log_likelihood, origin,
                                    impossible);
    });
}

// Write the labels (T,) of the path that ends in `last`.
template <class T>
void trace_back(Array<const T, 2> origin, int64_t last, Array<int64_t, 1> out) {
    for (int64_t t = out.shape(0) - 1; t >= 0; --t) {
        out(t) = last;
        if (t > 0) last = origin(t, last);
    }
}

template <class T> void add_all(pgm::Module &module) {
    module.add("viterbi_chain", viterbi_chain<T>, "best_score"_a, "begun"_a, "log_transition_t"_a,
               "action"_a, "log_likelihood"_a, "origin"_a, "impossible"_a);
    module.add("trace_back", trace_back<T>, "origin"_a, "last"_a, "out"_a);
}

}  // namespace

PGM_KERNELS(module) {
    module.add("subtract_best", subtract_best, "log_likelihood"_a, "out"_a, "best"_a);
    module.add("filter_chain", filter_chain, "belief"_a, "begun"_a, "transition_t"_a, "steps"_a);
    module.add("smooth_chain", smooth_chain, "transition_t"_a, "action"_a, "beliefs"_a);
    add_all<std::int8_t>(module);
    add_all<std::int16_t>(module);
}
