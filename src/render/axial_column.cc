#include "render/droplet.h"

namespace birefit {

#define BIREFIT_INSTANTIATE(S) template class AxialColumn<S>;
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

}  // namespace birefit
