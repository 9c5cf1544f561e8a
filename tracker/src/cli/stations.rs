//! From opened sources to stations: backgrounds, observers, and what each of them is asked for.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use rayon::prelude::*;
use tracker::Error;
use tracker::film::FilmOptions;
use tracker::foreground::health::Health;
use tracker::foreground::{Foreground, Start};
use tracker::method::{Method, Needs};
use tracker::source::{CameraSource, CaptureTimes, VideoSource};
use tracker::stage::Stage;
use tracker::station::{LiveStation, Masks, Observer, PictureDemand, RecordedStation, Station, Work};

use super::background::BackgroundArguments;

/// What pictures are drawn for, and when.
#[derive(Clone)]
pub(super) struct Drawing<'a> {
    pub(super) looks: &'a FilmOptions,
    pub(super) demand: PictureDemand,
}

/// Makes the stations of a run.
pub(super) struct StationBuilder<'a> {
    pub(super) stage: &'a Stage,
    pub(super) background: &'a BackgroundArguments,
    pub(super) needs: Needs,
    pub(super) drawing: Drawing<'a>,
    /// Whether some camera of the run is live: recordings are then played as fast as they were filmed.
    pub(super) is_live: bool,
}

impl StationBuilder<'_> {
    /// The stations in the sources' order; backgrounds are learnt in parallel. The method is told of the empty scenes that it
    /// asks for.
    pub(super) fn build(
        &self,
        sources: Vec<CameraSource>,
        times: Vec<CaptureTimes>,
        method: &mut dyn Method,
    ) -> anyhow::Result<Vec<Station>> {
        let made: Vec<anyhow::Result<(Station, Option<Start>)>> = sources
            .into_par_iter()
            .zip(times)
            .enumerate()
            .map(|(camera, (source, times))| self.station(camera, source, times))
            .collect();
        // All are made before the first failure is told, so that it is the first camera's.
        let mut stations = Vec::new();
        for (camera, made) in made.into_iter().enumerate() {
            let (station, start) = made?;
            if let Some(Start::Backdrop(backdrop)) = start {
                let undistort = &self.stage.cameras[camera].undistort;
                method.set_empty_scene(camera, &undistort.image(&backdrop.picture));
            }
            stations.push(station);
        }
        Ok(stations)
    }

    /// The station of one source, and its background where the method asks for that.
    fn station(
        &self,
        camera: usize,
        source: CameraSource,
        times: CaptureTimes,
    ) -> anyhow::Result<(Station, Option<Start>)> {
        let rate_hz = source.rate().or_else(|| (!source.is_live()).then(|| times.mean_rate()));
        let CameraSource { name, video, masks } = source;
        let masks = masks.filter(|_| self.needs.masks);
        if self.needs.pictures && video.is_none() {
            let problem = format!("camera `{name}` has masks alone; give --video {name}=PATH");
            return Err(Error::option("--video", problem).into());
        }
        let of_stage = &self.stage.cameras[camera];
        let size = (of_stage.width(), of_stage.height());
        let filmed_size = (of_stage.filmed.intrinsics.width, of_stage.filmed.intrinsics.height);
        let is_subtracted = self.needs.masks && masks.is_none();
        let start = match &video {
            Some(video) if is_subtracted || self.needs.empty_scene => {
                Some(self.background.start(&name, video, filmed_size, size)?)
            }
            _ => None,
        };
        let made = match (&masks, &start) {
            (Some(masks), _) => Masks::ready(masks.name()),
            (None, Some(start)) if is_subtracted => {
                let options = self.background.options();
                Masks::Subtracted(Box::new(Foreground::new(size.0, size.1, start.clone(), options)?))
            }
            _ => Masks::Unneeded(Health::default()),
        };
        let observer = Observer::new(self.stage, &name, made, self.needs)?;
        let drawn = (self.drawing.looks.panel_px(of_stage), self.drawing.demand.clone());
        let work = match video {
            Some(VideoSource::Live(source)) => Work::Live(Box::new(LiveStation {
                source,
                observer,
                filmed_size,
                drawn,
                passed_over: Arc::new(AtomicU64::new(0)),
            })),
            video => {
                let video = video.and_then(|video| match video {
                    VideoSource::Recorded(source) => Some(source),
                    VideoSource::Live(_) => None,
                });
                let paced = self.is_live;
                Work::Recorded(Box::new(RecordedStation { video, masks, times, observer, drawn, paced }))
            }
        };
        Ok((Station { name, rate_hz, work }, start.filter(|_| self.needs.empty_scene)))
    }
}
