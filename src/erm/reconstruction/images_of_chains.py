r"""Images that are those of chains off known walls.

Paths of several positions show an image far better than each of them alone, and an adjustment in which the image is
free shows it together with the walls: their common errors cancel. Of a chain whose image is apart by ``d``, of
covariance ``C``, the odds to an image anywhere within the longest path ``R`` are

.. math:: \frac{\pi R^2}{2 \pi J \sqrt{|C|}} e^{-d^T C^{-1} d / 2},

``J`` the number of chains.
"""

from collections.abc import Sequence

import numpy as np

from erm.common.odds import THOUSAND_TO_ONE
from erm.geometry.chains import NO_FACE, chain_images
from erm.geometry.vertical import FloatArray
from erm.mpcs.standard_errors import SIGMAS
from erm.reconstruction.decision.chains import MAX_CHAINS, Chains, ChainSearch
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.paths import IntArray
from erm.reconstruction.model.wall import Wall
from erm.survey.bundle import Bundle


def chains_of_images(
    images: Sequence[Wall], found: Bundle, walls: int, search: ChainSearch, lines: Lines
) -> list[Chains]:
    """Chains of two or three walls that some of the images are.

    Parameters
    ----------
    images : sequence of Wall
        Each of one transmitter.
    found : Bundle
        Adjustment of the walls, followed by the images.
    walls : int
        Number of walls.
    search : ChainSearch
        Of chains off the walls.
    lines : Lines
        Of the walls.
    """
    tried = np.argwhere(~np.eye(walls, dtype=bool))
    tried = np.vstack([np.column_stack([tried, tried[:, 0]]), np.column_stack([tried, np.full(len(tried), NO_FACE)])])
    if not 0 < len(tried) <= MAX_CHAINS:
        return []
    chains = [_chain_of(image, walls + k, tried, found, search, lines) for k, image in enumerate(images)]
    return [one for one in chains if one is not None]


def _chain_of(
    image: Wall, number: int, tried: IntArray, found: Bundle, search: ChainSearch, lines: Lines
) -> Chains | None:
    tx = image.paths.tx[:1, :2]
    own, own_slope = chain_images(tx, np.array([[number]]), *found.faces)
    places, slopes = chain_images(np.repeat(tx, len(tried), axis=0), tried, *found.faces)
    apart = places[-1] - own[-1]
    faces = np.column_stack([tried, np.full(len(tried), number)])
    slopes = np.concatenate([slopes, -np.repeat(own_slope, len(tried), axis=0)], axis=1)
    near = np.linalg.norm(apart, axis=-1) < SIGMAS * _reach(slopes, faces, found.face_covariance)
    tried, apart, faces, slopes = tried[near], apart[near], faces[near], slopes[near]
    if not len(tried):
        return None
    both = found.face_covariance[faces[:, :, None], :, faces[:, None, :]]
    covariance = np.einsum("cbik,cbdkl,cdjl->cij", slopes, both, slopes)
    chi_squared = np.einsum("ci,cij,cj->c", apart, np.linalg.inv(covariance), apart)
    area = np.max(image.paths.length) ** 2 / (2 * len(places[-1]))
    log_odds = np.log(area) - np.linalg.slogdet(covariance)[1] / 2 - chi_squared / 2
    best = int(np.argmax(log_odds))
    if log_odds[best] < THOUSAND_TO_ONE:
        return None
    chain = np.tile(tried[best][tried[best] != NO_FACE], (image.support, 1))
    possible = search.possible(image.paths, chain, lines)  # the others met the walls of a corner in the other order
    return Chains(image.paths.take(possible), chain[possible]) if np.mean(possible) > 0.5 else None


def _reach(slopes: FloatArray, faces: IntArray, covariance: FloatArray) -> FloatArray:
    """Upper bound (chain,) of the standard deviation of sums of errors of faces."""
    own = covariance[np.arange(len(covariance)), :, np.arange(len(covariance))][faces]
    return np.sqrt(np.einsum("cbik,cbkl,cbil->cb", slopes, own, slopes)).sum(axis=1)
