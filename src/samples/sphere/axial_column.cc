#include "samples/sphere/droplet.h"

namespace birefit {

#define BIREFIT_INSTANTIATE(S) template class AxialColumn<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
