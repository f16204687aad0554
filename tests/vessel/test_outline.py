import numpy as np

from shipid.vessel.outline import ship_outline


def test_the_outline_is_to_scale_closed_and_symmetric():
    outline = ship_outline({"L_oa": 31.25, "L_pp": 28.9, "B": 9.6})
    assert (np.ptp(outline[:, 0]), np.ptp(outline[:, 1])) == (31.25, 9.6)
    np.testing.assert_array_equal(outline[0], outline[-1])
    mirrored = {(x, -y) for x, y in outline.tolist()}
    assert mirrored == set(map(tuple, outline.tolist()))
    bow = outline[outline[:, 0].argmax()]
    assert bow[1] == 0.0, "the bow is pointed and ahead"
