// Ranges from all cells of a tile along the beams of one octant, swept column by column.
//
// All cells share the same directions. Mirror and swap axes so that a direction goes right and up with
// slope m from 0 to 1. A ray keeps its u = y - m x all the way, so a picture of what a viewer far to
// the left sees is one-dimensional: for every u, the first face. Columns are swept from right to left.
// The cells of a column look their faces up in the picture of all that lies to the right of them, then
// the column's own blocked cells are painted over it:
//
//     near side of cell (X, Y), facing left      u from Y - m X        to Y + 1 - m X
//     lower side, facing down                    u from Y - m (X + 1)  to Y - m X
//
// A near side is (X - x) / major away from a cell centre at x, a lower side (Y - y) / minor.
//
// Columns and rows are counted in the tile's region, a window of the map with everything that its
// beams can reach. Fractions of u are computed from columns of the map, so that all tiles have the same
// bins and tiling does not change a bit of the result.

#include "pgm_places/kernels/registry.hpp"
#include "pgm_places/sensing/_dda.hpp"
#include "pgm_places/sensing/_picture.hpp"

namespace {

using namespace pgm::sensing;
using pgm::Array;
using std::int64_t;

constexpr int64_t PREFETCH_AHEAD = 16;  // cells between fetching a line of the output and writing it

// What a column of the tile holds.
struct Opened {
    int64_t n_cells = 0, n_spans = 0;
};

// Note the wanted cells of column `k` of the tile.
//
// `column.nodes` gets the output's row of each wanted cell and -1 elsewhere, `column.cells` the rows
// of the wanted cells, `column.spans` the stretches of cells looked up together.
PGM_INLINE Opened open_column(const TileCells &tile, int64_t k, bool downward,
                              const Column &column) {
    const int64_t first = tile.runs.starts(k), last = tile.runs.starts(k + 1);
    const auto &runs = tile.runs.entries;
    const auto nodes = tile.nodes[k];
    const int64_t n_rows = nodes.size();
    std::fill(column.nodes.begin(), column.nodes.end(), -1);
    Opened found;
    for (int64_t j = 0; j < last - first; ++j) {
        // Upside down the last run comes first.
        const int64_t run = downward ? last - 1 - j : first + j;
        const int64_t begin = downward ? n_rows - runs(run, 1) : runs(run, 0);
        const int64_t end = downward ? n_rows - runs(run, 0) : runs(run, 1);
        for (int64_t y = begin; y < end; ++y) {
            column.nodes(y) = nodes(downward ? n_rows - 1 - y : y);
            column.cells(found.n_cells++) = static_cast<std::int32_t>(y);
        }
        if (found.n_spans > 0 && begin - column.spans(found.n_spans - 1, 1) < BLOCK) {
            column.spans(found.n_spans - 1, 1) = static_cast<std::int32_t>(end);
        } else {
            column.spans(found.n_spans, 0) = static_cast<std::int32_t>(begin);
            column.spans(found.n_spans, 1) = static_cast<std::int32_t>(end);
            ++found.n_spans;
        }
    }
    return found;
}

// Follow the rays of a column with negative, that is unknown, readings cell by cell.
//
// The column is column `at` of the region, counted along the map's axis.
PGM_INLINE void follow_mixed(const Column &column, int64_t n_cells,
                             const Array<const std::uint8_t, 2> &blocked, const Frame &frame,
                             int64_t at, const Rays &rays) {
    const int64_t flip = frame.x_is_major ? blocked.shape(0) : blocked.shape(1);
    for (int64_t beam = 0; beam < rays.size(); ++beam) {
        if (!column.mixed(beam)) continue;
        const int64_t first = beam * (column.readings.size() / rays.size());
        const BeamSteps steps = {rays.whole(beam, STEP_X),
                                 rays.whole(beam, STEP_Y),
                                 rays.of(beam, PER_X),
                                 rays.of(beam, PER_Y),
                                 static_cast<float>(rays.of(beam, METRES_X)),
                                 static_cast<float>(rays.of(beam, METRES_Y))};
        for (int64_t k = 0; k < n_cells; ++k) {
            float &reading = column.readings(first + column.cells(k));
            if (reading >= 0.0f) continue;
            int64_t row = frame.tile_row + column.cells(k);
            if (frame.downward) row = flip - 1 - row;
            reading = centre_range(blocked, frame.x_is_major ? row : at,
                                   frame.x_is_major ? at : row, steps, rays.limit, rays.cap);
        }
    }
}

// Turn one column's readings (beams, rows) into parts of the output's rows (cells, n_all).
PGM_INLINE void write_column(const Column &column, int64_t n_cells, int64_t n_beams,
                             const Output &output) {
    const int64_t stride = column.readings.size() / n_beams;
    const auto place = [&](int64_t i) {
        return column.nodes(column.cells(i)) * output.n_all + output.first_beam;
    };
    for (int64_t i = 0; i < n_cells; ++i) {
        if (i + PREFETCH_AHEAD < n_cells) {
            const float *begin = output.ranges.data() + place(i + PREFETCH_AHEAD);
            for (int64_t beam = 0; beam < n_beams; beam += 16) __builtin_prefetch(begin + beam, 1);
            __builtin_prefetch(begin + n_beams - 1, 1);
        }
        const float *__restrict source = column.readings.data() + column.cells(i);
        float *__restrict target = output.ranges.data() + place(i);
        for (int64_t beam = 0; beam < n_beams; ++beam) target[beam] = source[beam * stride];
    }
}

// Write the ranges of a tile's wanted cells along neighbouring beams of one octant.
//
// `pictures` and `column` are working memory.
struct Sweep {
    template <int BYTES>
    static PGM_INLINE void run(Region region, TileCells tile, Frame frame, Rays rays,
                               Pictures pictures, Column column, Output output) {
        const auto &near_starts = region.near.starts, &lower_starts = region.lower.starts;
        const int64_t n_columns = near_starts.size() - 1;
        const int64_t tile_end = frame.tile_column + tile.nodes.shape(0);
        // Where nothing gets painted, the face is so far away that the range is the maximum.
        const int64_t reach = tile_end + static_cast<int64_t>(rays.limit);
        const auto far = static_cast<std::int32_t>(reach + 2);
        std::fill(pictures.pairs.begin(), pictures.pairs.end(), pair_of(far, far));
        for (int64_t x = std::min(reach + 1, n_columns - 1); x >= frame.tile_column; --x) {
            const int64_t i = frame.backward ? n_columns - 1 - x : x;
            Opened opened;
            if (x < tile_end) {
                const int64_t k = frame.backward ? tile_end - 1 - x : x - frame.tile_column;
                opened = open_column(tile, k, frame.downward, column);
            }
            if (opened.n_cells > 0) {
                answer_column(column, opened.n_spans, frame, x, rays, pictures);
                follow_mixed(column, opened.n_cells, region.blocked, frame, i, rays);
                write_column(column, opened.n_cells, rays.size(), output);
            }
            const int64_t k = frame.downward ? n_columns - 1 - i : i;
            if (near_starts(k) < near_starts(k + 1) || lower_starts(k) < lower_starts(k + 1))
                paint_column(region, k, x, frame.map_column + x, rays, pictures);
        }
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("sweep", pgm::variants<Sweep>, "region"_a, "tile"_a, "frame"_a, "rays"_a,
               "pictures"_a, "column"_a, "output"_a);
}
