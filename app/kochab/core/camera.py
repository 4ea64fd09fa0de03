"""The camera: how a direction becomes a pixel and back.

Camera axes: x right, y down, z out along the boresight. A point of the tangent plane is
``u = X/Z, v = Y/Z``. Distortion (Brown-Conrady) takes the ideal ``(u, v)`` to the recorded one::

    r2 = u^2 + v^2;  radial = 1 + k1 r2 + k2 r2^2
    ud = u radial + 2 p1 u v + p2 (r2 + 2 u^2)
    vd = v radial + p1 (r2 + 2 v^2) + 2 p2 u v

and the pixel is ``x = cx + s a f ud, y = cy + f vd`` with ``s = -1`` for a mirrored frame, else +1, and ``a`` the
aspect ratio of an image that was resized, 1 for square pixels. A mirrored camera's x axis therefore points to the left
of the screen, so that the attitude stays a proper rotation.

Behind a fisheye lens the point is ``(u, v) = theta (X, Y) / hypot(X, Y)``, theta the angle from the boresight: the
equidistant projection, bent by the same terms (Kannala and Brandt 2006, IEEE Trans. PAMI 28, 1335, whose odd powers of
theta these are).
"""

from typing import ClassVar

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.values import frozen

NEAREST = 1e-3  # what lies behind a camera is taken to be this far before it, where places must be finite
FIELDS = 1.5  # how far beside the frame places are told, in half diagonals


@frozen
class Camera:
    """Optics of one frame; lengths in px, pixel (0, 0) is the centre of the first pixel.

    ``focal_px`` counts pixels along y; along x there are ``aspect`` times as many to the same angle.
    """

    projection: ClassVar[str] = "gnomonic"
    widest_deg: ClassVar[float] = 180.0
    circle_rad: ClassVar[float] = float("inf")  # so far from the axis on the plane it shows stars

    width: int
    height: int
    focal_px: float
    cx: float
    cy: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    mirrored: bool = False
    aspect: float = 1.0

    @classmethod
    def centred(cls, width: int, height: int, focal_px: float, mirrored: bool = False) -> "Camera":
        """A camera without distortion whose principal point is the frame's centre.

        Parameters
        ----------
        width, height : int
            Size of the frame, px.
        focal_px : float
            Focal length, px.
        mirrored : bool
            Whether the frame shows the sky mirrored.
        """
        return cls(width, height, focal_px, (width - 1) / 2, (height - 1) / 2, mirrored=mirrored)

    @property
    def scale_arcsec_px(self) -> float:
        """Pixel scale at the principal point, the mean of both directions."""
        return float(np.degrees(1.0 / (self.focal_px * self.aspect**0.5)) * 3600.0)

    @property
    def focal_xy_px(self) -> Floats:
        """Focal lengths (2,) along the pixels' rows, negative for a mirrored frame, and columns, px."""
        return np.array([(-self.aspect if self.mirrored else self.aspect) * self.focal_px, self.focal_px])

    @property
    def fov_deg(self) -> tuple[float, float]:
        """Width and height of the undistorted field, edge to edge."""
        sides = np.array([self.width / self.aspect, self.height])
        w, h = np.degrees(2.0 * np.arctan(sides / (2.0 * self.focal_px)))
        return float(w), float(h)

    @classmethod
    def sides_px(cls, focal_px: float, fov_deg: Floats) -> Floats:
        """The sides (2,) of a frame with this focal length and field, in square px, as :attr:`fov_deg` says it."""
        return np.asarray(2.0 * focal_px * np.tan(np.radians(fov_deg) / 2.0))

    def project(self, vectors: Floats) -> Floats:
        """Pixels (N, 2) of unit vectors (N, 3) in camera axes; NaN behind the camera."""
        return self.recorded(self.plane(np.asarray(vectors, dtype=np.float64)))

    def recorded(self, uv: Floats) -> Floats:
        """Pixels (N, 2) of ideal points (N, 2)."""
        return self._pixels(self.bent(uv) if self.distorted else uv)

    def unproject(self, pixels: Floats) -> Floats:
        """Unit vectors (N, 3) in camera axes of pixels (N, 2)."""
        p = np.asarray(pixels, dtype=np.float64)
        uvd = (p - (self.cx, self.cy)) / self.focal_xy_px
        return self.rays(self._straighten(uvd) if self.distorted else uvd)

    def plane(self, vectors: Floats) -> Floats:
        """Ideal points (u, v) (N, 2) of unit vectors (N, 3) in camera axes; NaN behind the camera."""
        with np.errstate(divide="ignore", invalid="ignore"):
            # At 90° off axis u and v grow without bound; what lies behind must not be seen mirrored in front.
            return np.where(vectors[..., 2:] > 1e-6, vectors[..., :2] / vectors[..., 2:], np.nan)

    def ahead(self, vectors: Floats) -> Floats:
        """The same as columns (2, N) of vectors (N, 3), finite: what lies behind the camera is far outside."""
        return np.asarray(vectors[:, :2].T / np.maximum(vectors[:, 2], NEAREST))

    def turn(self, flat: Floats, out: Floats) -> None:
        """Write how ideal points (2, N) move when the axes turn about x, and about y, into ``out`` (2, 2, N)."""
        u, v = flat
        out[0, 0], out[0, 1] = -u * v, -1.0 - v * v
        out[1, 0], out[1, 1] = 1.0 + u * u, u * v

    def rays(self, uv: Floats) -> Floats:
        """Unit vectors (N, 3) in camera axes of ideal points (N, 2)."""
        out = np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)
        return np.asarray(out / np.linalg.norm(out, axis=-1, keepdims=True))

    @property
    def distorted(self) -> bool:
        """Whether any distortion term is set."""
        return any((self.k1, self.k2, self.p1, self.p2))

    @property
    def reach_rad(self) -> float:
        """The angle from the optical axis up to which a direction may be asked for.

        That is half again as far as the frame's farthest corner, or where the distortion turns back: 1 + 3 k1 r2 +
        5 k2 r2^2, the derivative of the recorded radius, is zero there.
        """
        corners = np.array([[x, y] for x in (-0.5, self.width - 0.5) for y in (-0.5, self.height - 0.5)])
        far = float(np.arccos(np.clip(self.unproject(corners)[:, 2].min(), -1.0, 1.0)))
        # Solved for 1 / r2, whose leading factor is 1 however small k1 and k2 are; only real, positive ones are radii.
        turns = np.roots([1.0, 3.0 * self.k1, 5.0 * self.k2])
        nearest = turns.real[(np.abs(turns.imag) < 1e-12) & (turns.real > 0.0)].max(initial=0.0)
        at_most = min(FIELDS * far, self._widest_rad)
        return min(at_most, self._off_axis_rad(float(nearest**-0.5))) if nearest > 0.0 else at_most

    @property
    def _widest_rad(self) -> float:
        return float(np.radians(89.0))

    def _off_axis_rad(self, radius: float) -> float:
        """The angle from the optical axis of an ideal point so far from it."""
        return float(np.arctan(radius))

    def bent(self, uv: Floats) -> Floats:
        """The recorded points of the tangent plane (..., 2) of ideal ones."""
        u, v = uv[..., 0], uv[..., 1]
        r2 = u * u + v * v
        radial = 1.0 + r2 * (self.k1 + self.k2 * r2)
        ud = u * radial + 2.0 * self.p1 * u * v + self.p2 * (r2 + 2.0 * u * u)
        vd = v * radial + self.p1 * (r2 + 2.0 * v * v) + 2.0 * self.p2 * u * v
        return np.stack([ud, vd], axis=-1)

    def bending(self, u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        """Derivatives of recorded points by ideal ones: of u by u, of v by v, and of each by the other."""
        r2 = u * u + v * v
        radial = 1.0 + r2 * (self.k1 + self.k2 * r2)
        slope = 2.0 * (self.k1 + 2.0 * self.k2 * r2)  # of radial, over u or v
        uu = radial + u * u * slope + 2.0 * self.p1 * v + 6.0 * self.p2 * u
        vv = radial + v * v * slope + 6.0 * self.p1 * v + 2.0 * self.p2 * u
        return uu, vv, u * v * slope + 2.0 * self.p1 * u + 2.0 * self.p2 * v

    def _straighten(self, uvd: Floats) -> Floats:
        """The ideal (u, v) of recorded ones, by Newton's steps: the error squares at each."""
        uv = uvd.copy()
        # Six at most: beyond the fold of a barrel lens there is no solution to converge to.
        for _ in range(6):
            uu, vv, uv_ = self.bending(uv[..., 0], uv[..., 1])
            du, dv = np.moveaxis(uvd - self.bent(uv), -1, 0)
            det = uu * vv - uv_ * uv_
            step = np.stack([vv * du - uv_ * dv, uu * dv - uv_ * du], axis=-1)
            # Near the fold of a barrel lens the determinant goes to zero: a plain step there does not jump away.
            step /= np.where(np.abs(det) > 0.01, det, 1.0)[..., None]
            uv = uv + step
            if not (np.abs(step) > 1e-14).any():
                break
        return uv

    def _pixels(self, uvd: Floats) -> Floats:
        return np.asarray(uvd * self.focal_xy_px + (self.cx, self.cy))


@frozen
class FisheyeCamera(Camera):
    """A fisheye lens, of up to the whole sky: pixels from the axis are as angles from it, but for the distortion."""

    projection: ClassVar[str] = "equidistant"
    widest_deg: ClassVar[float] = 720.0  # beside the lens's circle there is frame, but no sky
    circle_rad: ClassVar[float] = float(np.radians(92.0))  # one that looks up shows stars to the horizon

    @property
    def fov_deg(self) -> tuple[float, float]:
        """Width and height of the undistorted field, edge to edge."""
        w, h = np.degrees(np.array([self.width / self.aspect, self.height]) / self.focal_px)
        return float(w), float(h)

    @classmethod
    def sides_px(cls, focal_px: float, fov_deg: Floats) -> Floats:
        """The sides (2,) of a frame with this focal length and field, in square px."""
        return np.asarray(focal_px * np.radians(fov_deg))

    def plane(self, vectors: Floats) -> Floats:
        """Ideal points (u, v) (N, 2) of unit vectors (N, 3) in camera axes, radians from the axis."""
        across = np.hypot(vectors[..., 0], vectors[..., 1])
        theta = np.arctan2(across, vectors[..., 2])
        return np.asarray(vectors[..., :2] * (theta / np.maximum(across, 1e-15))[..., None])

    def ahead(self, vectors: Floats) -> Floats:
        """The same as columns (2, N)."""
        return self.plane(vectors).T

    def turn(self, flat: Floats, out: Floats) -> None:
        """Write how ideal points (2, N) move when the axes turn about x, and about y, into ``out`` (2, 2, N).

        At theta from the axis a turn along the radius moves a point by as much, one across it by theta / tan(theta).
        """
        u, v = flat
        r2 = u * u + v * v
        theta = np.sqrt(r2)
        across = np.where(theta > 1e-6, theta / np.tan(np.maximum(theta, 1e-6)), 1.0)
        along = (1.0 - across) / np.maximum(r2, 1e-12)
        out[0, 0], out[0, 1] = -along * u * v, -(across + along * v * v)
        out[1, 0], out[1, 1] = across + along * u * u, along * u * v

    def rays(self, uv: Floats) -> Floats:
        """Unit vectors (N, 3) in camera axes of ideal points (N, 2); farther than 180 deg they stand behind."""
        theta = np.minimum(np.hypot(uv[..., 0], uv[..., 1]), np.pi)
        across = uv * np.sinc(theta / np.pi)[..., None]
        return np.concatenate([across, np.cos(theta)[..., None]], axis=-1)

    @property
    def _widest_rad(self) -> float:
        return float(np.radians(95.0))  # a lens that looks up shows the horizon, and refraction a little more

    def _off_axis_rad(self, radius: float) -> float:
        return radius


PROJECTIONS: dict[str, type[Camera]] = {kind.projection: kind for kind in (Camera, FisheyeCamera)}
"""The models of a lens by the name that files give them."""


@frozen
class ChartCamera(Camera):
    """A stereographic chart of up to a hemisphere: small circles stay circles, and little is stretched.

    A point of it is ``u = 2 X / (1 + Z), v = 2 Y / (1 + Z)``; the scale is that of its middle.
    """

    @classmethod
    def of(cls, width: int, height: int, field_deg: float) -> "ChartCamera":
        """A chart of ``width`` x ``height`` px whose shorter side is ``field_deg`` degrees long, at most 180."""
        focal_px = min(width, height) / (4.0 * float(np.tan(np.radians(field_deg) / 4.0)))
        return cls(width, height, focal_px, (width - 1) / 2, (height - 1) / 2)

    @property
    def reach_rad(self) -> float:
        """A quarter of the sky to each side."""
        return float(np.pi / 2.0)

    def project(self, vectors: Floats) -> Floats:
        """Pixels (N, 2) of unit vectors (N, 3) in camera axes; NaN behind the camera."""
        v = np.asarray(vectors, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            return self._pixels(np.where(v[..., 2:] > 0.0, 2.0 * v[..., :2] / (1.0 + v[..., 2:]), np.nan))

    def unproject(self, pixels: Floats) -> Floats:
        """Unit vectors (N, 3) in camera axes of pixels (N, 2)."""
        uv = (np.asarray(pixels, dtype=np.float64) - (self.cx, self.cy)) / (2.0 * self.focal_px)
        r2 = (uv * uv).sum(axis=-1, keepdims=True)
        return np.asarray(np.concatenate([2.0 * uv, 1.0 - r2], axis=-1) / (1.0 + r2))
