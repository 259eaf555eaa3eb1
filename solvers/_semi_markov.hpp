// How labels of semi-Markov chains last, and what is held of each state.

#pragma once

#include <algorithm>
#include <cstdint>

#include "pgm_places/kernels/array.hpp"

namespace pgm::semi_markov {

using std::int64_t;
using Row = Array<double, 1>;
using Matrix = Array<double, 2>;
using ConstRow = Array<const double, 1>;
using ConstMatrix = Array<const double, 2>;

struct Rates {  // see semi_markov.py
    ConstMatrix leaving;
    ConstRow edges_m;
    ConstMatrix rates, sums;
    auto fields() { return std::tie(leaving, edges_m, rates, sums); }

    int64_t n_labels() const { return rates.shape(0); }
    int64_t n_rates() const { return rates.shape(1); }

    // The rate at an age, looked for from the rate `b` on.
    int64_t bin_of(double age_m, int64_t b) const {
        while (b + 1 < n_rates() && age_m >= edges_m(b + 1)) ++b;
        return b;
    }

    // The rate's integral from age 0 to an age in bin `b`.
    double integral(int64_t label, int64_t b, double age_m) const {
        return sums(label, b) + rates(label, b) * (age_m - edges_m(b));
    }

    // The rate's integral from one age to a later one, in bins `before` and `after`.
    double over(int64_t label, int64_t before, double age_m, int64_t after, double aged_m) const {
        const double through = integral(label, after, aged_m) - integral(label, before, age_m);
        return std::max(through, 0.0);
    }

    double last_rate(int64_t label) const { return rates(label, n_rates() - 1); }
};

struct States {  // see semi_markov.py
    ConstRow at_m;
    Matrix recent;
    Row old;
    auto fields() { return std::tie(at_m, recent, old); }
};

}  // namespace pgm::semi_markov
