// The extension module: it holds what the files of kernels have registered.

#include "pgm_places/kernels/simd.hpp"
#include "pgm_places/kernels/registry.hpp"

NB_MODULE(_core, module) {
    module.doc() = "Compiled kernels; the Python functions beside their sources check arguments.";
    module.def("widest_registers", pgm::widest_registers, "Width in bytes, of this processor.");
    module.def(
        "limit_registers", [](int bytes) { pgm::register_limit() = bytes; }, "bytes"_a,
        "Have kernels use registers of 16, 32 or 64 bytes, if there are such.");
    pgm::register_all(module);
}
