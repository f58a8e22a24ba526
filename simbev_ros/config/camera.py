"""Camera sensors of a rig: intrinsics, lens distortion, optics and modalities."""

import math
from dataclasses import asdict
from functools import lru_cache
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from simbev_ros.config.modalities import IMAGE_KINDS, MODALITIES, Modality
from simbev_ros.config.optics import Optics
from simbev_ros.config.presets import filled_in, preset_of, require_known
from simbev_ros.config.sensor import Sensor
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_IMAGE_SIDE_PX
from simbev_ros.foundation.geometry.camera import MAX_RAY_ANGLE_RAD, LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import MAX_ANGLE_RAD, FisheyeCamera, focal_length_px

_FIELD_OF_VIEW_DEG = 80.0
_MAX_PINHOLE_FOV_DEG = 170.0
_MAX_FISHEYE_FOV_DEG = round(2.0 * math.degrees(MAX_ANGLE_RAD))
_IMAGE_CIRCLE_DEG = 200.0
_COEFFICIENTS = {"plumb_bob": ("k1", "k2", "p1", "p2", "k3"), "equidistant": ("k1", "k2", "k3", "k4")}


class Camera(Sensor, Optics):
    """A camera with one or more modalities.

    Give its intrinsics either as a horizontal field of view, or as a focal length with any other intrinsics that differ
    from their defaults.
    """

    type: Literal["camera"]
    preset: str | None = Field(
        None, description="a manufacturer's model, which provides the values that are not given here"
    )
    width_px: int = Field(1600, ge=16, le=MAX_IMAGE_SIDE_PX, description="image width")
    height_px: int = Field(900, ge=16, le=MAX_IMAGE_SIDE_PX, description="image height")
    horizontal_fov_deg: float | None = Field(
        None,
        gt=1,
        le=_MAX_FISHEYE_FOV_DEG,
        description="horizontal field of view, edge to edge; plumb_bob: less than 170, without distortion, none: 80 if "
        "fx_px is not set; equidistant: with distortion",
    )
    fx_px: float | None = Field(
        None, gt=0, le=1e6, description="horizontal focal length, instead of horizontal_fov_deg"
    )
    fy_px: float | None = Field(
        None, gt=0, le=1e6, description="vertical focal length, with fx_px; none: equal to fx_px"
    )
    cx_px: float | None = Field(
        None, ge=-8192, le=16384, description="principal point in x, with fx_px; none: (width_px - 1) / 2"
    )
    cy_px: float | None = Field(
        None, ge=-8192, le=16384, description="principal point in y, with fx_px; none: (height_px - 1) / 2"
    )
    distortion_model: Literal["plumb_bob", "equidistant"] = Field(
        "plumb_bob",
        description="lens (sensor_msgs/CameraInfo): plumb_bob, or equidistant for a fisheye (cv2.fisheye), whose depth "
        "is along the ray of a pixel, and whose vignetting is an exponent on the relative solid angle of a pixel",
    )
    distortion: tuple[Annotated[float, Field(ge=-100, le=100)], ...] = Field(
        (0.0,) * 5,
        max_length=5,
        description="distortion coefficients of OpenCV: k1, k2, p1, p2, k3 of plumb_bob; k1, k2, k3, k4 of equidistant",
    )
    image_circle_deg: float | None = Field(
        None,
        gt=1,
        le=_MAX_FISHEYE_FOV_DEG,
        description="full angle of the image circle of an equidistant lens, outside which pixels are black, unlabeled, "
        "infinitely far and without flow; none: 200, or horizontal_fov_deg if that is more",
    )
    modalities: tuple[Modality, ...] = Field(
        MODALITIES,
        min_length=1,
        description="kinds of images that the camera publishes; raw: the mosaic of an imager, in 8 bits",
    )
    labels: Literal["visible", "drawn"] = Field(
        "visible",
        description="semantic images: visible is the class of the surface at each pixel's center; drawn is what people "
        "draw on photographs, where crowns, railings and two-wheelers include what is seen through their gaps",
    )

    video: Literal["h264"] | None = Field(
        None,
        exclude_if=lambda value: value is None,
        description="color images also as foxglove_msgs/CompressedVideo, on the topic rgb/video, which bags contain in "
        "place of JPEG; none: no video",
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, data: Any) -> Any:
        """Fill in the values of a preset, and a fisheye's number of coefficients."""
        if not isinstance(data, dict):
            return data
        data = filled_in(data, preset_of("camera", data))
        return {"distortion": (0.0,) * 4, **data} if data.get("distortion_model") == "equidistant" else data

    @model_validator(mode="after")
    def _known_preset(self) -> Self:
        require_known("camera", self.preset)
        return self

    @model_validator(mode="after")
    def _possible_modalities(self) -> Self:
        if len(set(self.modalities)) != len(self.modalities):
            raise ValueError(f"modalities: each at most once, not {list(self.modalities)}")
        of_imager = [name for name in self.modalities if IMAGE_KINDS[name].of_imager]
        if of_imager and self.imager is None:
            raise ValueError(f"modalities: {', '.join(of_imager)} without imager, which makes it")
        return self

    @model_validator(mode="after")
    def _possible_video(self) -> Self:
        if self.video is None:
            return self
        if "rgb" not in self.modalities:
            raise ValueError("video: needs the modality rgb")
        if self.width_px % 2 or self.height_px % 2:
            raise ValueError(f"video: {self.width_px} x {self.height_px} pixels; H.264 needs even numbers")
        return self

    @model_validator(mode="after")
    def _one_kind_of_intrinsics(self) -> Self:
        given = [name for name in ("fx_px", "fy_px", "cx_px", "cy_px") if getattr(self, name) is not None]
        if given and self.horizontal_fov_deg is not None:
            raise ValueError(f"horizontal_fov_deg and {', '.join(given)} are set: give one or the other")
        if given and self.fx_px is None:
            raise ValueError(f"{', '.join(given)} without fx_px, which must be set with them")
        return self

    @model_validator(mode="after")
    def _suits_distortion_model(self) -> Self:
        names, is_fisheye = _COEFFICIENTS[self.distortion_model], self.distortion_model == "equidistant"
        if len(self.distortion) != len(names):
            raise ValueError(
                f"distortion: has {len(self.distortion)} coefficients; {self.distortion_model} takes {', '.join(names)}"
            )
        fov_deg = self.horizontal_fov_deg
        if not is_fisheye and self.image_circle_deg is not None:
            raise ValueError("image_circle_deg: only for distortion_model: equidistant")
        if not is_fisheye and fov_deg is not None and fov_deg >= _MAX_PINHOLE_FOV_DEG:
            raise ValueError(f"horizontal_fov_deg: is {fov_deg:g}; from 170 on, it needs distortion_model: equidistant")
        if is_fisheye and fov_deg is None and self.fx_px is None:
            raise ValueError("distortion_model: equidistant needs horizontal_fov_deg or fx_px")
        if is_fisheye and self.imager is not None and self.imager.shutter is not None:
            raise ValueError("imager.shutter: not with distortion_model: equidistant")
        if is_fisheye and (computed := [name for name in self.modalities if IMAGE_KINDS[name].shader is not None]):
            raise ValueError(f"modalities: an equidistant camera has none with a shader: {', '.join(computed)}")
        return self

    @model_validator(mode="after")
    def _sees_its_image(self) -> Self:
        try:
            camera = self.model
        except InputError as error:
            raise ValueError(str(error)) from None
        if isinstance(camera, FisheyeCamera):
            return self
        edges = camera.rays(np.array([[-0.5, -0.5], [self.width_px - 0.5, self.height_px - 0.5]]))[:, :2]
        if np.abs(edges).max() > math.tan(MAX_RAY_ANGLE_RAD):
            raise ValueError(
                f"fx_px {camera.fx_px:g}, fy_px {camera.fy_px:g}: a pixel of an image of {self.width_px} x "
                f"{self.height_px} would look more than 85° away from the optical axis; take a greater focal length"
            )
        return self

    @property
    def model(self) -> PinholeCamera:
        """The camera's geometry: a ``FisheyeCamera`` if equidistant, a ``LensCamera`` if it distorts otherwise."""
        if self.distortion_model == "equidistant":
            return self._fisheye()
        ideal = self._pinhole()
        return _lens_camera(ideal, self.distortion) if any(self.distortion) else ideal

    def _fisheye(self) -> FisheyeCamera:
        fov_deg = self.horizontal_fov_deg or 0.0
        circle_deg = max(_IMAGE_CIRCLE_DEG, fov_deg) if self.image_circle_deg is None else self.image_circle_deg
        if fov_deg > circle_deg:
            raise InputError(f"image_circle_deg: is {circle_deg:g}, but horizontal_fov_deg is {fov_deg:g}")
        fx_px = self.fx_px
        if fx_px is None:
            fx_px = focal_length_px(self.width_px, math.radians(fov_deg), self.distortion)
        return FisheyeCamera(
            **asdict(self._with_focal_length(fx_px)),
            distortion=self.distortion,
            max_angle_rad=math.radians(circle_deg / 2.0),
        )

    def _pinhole(self) -> PinholeCamera:
        if self.fx_px is None:
            fov_deg = _FIELD_OF_VIEW_DEG if self.horizontal_fov_deg is None else self.horizontal_fov_deg
            return PinholeCamera.from_field_of_view(self.width_px, self.height_px, math.radians(fov_deg))
        return self._with_focal_length(self.fx_px)

    def _with_focal_length(self, fx_px: float) -> PinholeCamera:
        width_px, height_px = self.width_px, self.height_px
        return PinholeCamera(
            width_px,
            height_px,
            fx_px,
            fx_px if self.fy_px is None else self.fy_px,
            (width_px - 1) / 2.0 if self.cx_px is None else self.cx_px,
            (height_px - 1) / 2.0 if self.cy_px is None else self.cy_px,
        )


@lru_cache(maxsize=64)
def _lens_camera(ideal: PinholeCamera, distortion: tuple[float, ...]) -> LensCamera:
    """The camera with distortion, cached because its validation takes a millisecond."""
    return LensCamera(**asdict(ideal), distortion=distortion)
