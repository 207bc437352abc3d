//! Imperfections of sensors: noise, and the steps of their converters.

use super::System;
use crate::signal::random::NormalDeviates;
use crate::toml_text::{Diagnostic, NumberWithUnit};
use servotwin_model::components::Component;
use servotwin_model::scalar::Primitive;
use servotwin_model::spec::Unit;

/// Noise and quantization of one sensor, in physical units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Imperfection {
    sigma: f64,
    /// The step of the converter; zero for none.
    step: f64,
}

impl Imperfection {
    /// Reads the sensor's component: `noise_sigma` is relative to its full scale, and `bits` divide the whole range.
    pub(crate) fn of(system: &System, sensor: usize) -> Self {
        let instance = &system.network().components[system.sensors[sensor].component];
        Self::of_component(instance.component, &instance.parameters)
    }

    /// Reads a component with its parameters; without noise and steps if it is not a sensor.
    pub(crate) fn of_component(component: &Component, parameters: &[f64]) -> Self {
        let Some(span) = (component.span)(parameters) else {
            return Self { sigma: 0.0, step: 0.0 };
        };
        let spec = component;
        let value = |name: &str| spec.parameter(name).map_or(0.0, |p| parameters[p]);
        let bits = value("bits");
        let step = if bits > 0.0 { span.range / f64::powi(2.0, bits as i32) } else { 0.0 };
        Self { sigma: value("noise_sigma") * span.full_scale, step }
    }

    /// The standard deviation of a sample, in physical units: noise, and quantization as a uniform distribution over a
    /// step.
    pub(crate) fn deviation(self) -> f64 {
        (self.sigma * self.sigma + self.step * self.step / 12.0).sqrt()
    }

    /// Adds noise to a value and quantizes it.
    pub(crate) fn apply(self, value: f64, noise: &mut NormalDeviates) -> f64 {
        let noisy = value + self.sigma * noise.normal();
        // Rounds ties to even, without the cost of the standard library's call.
        if self.step > 0.0 { Primitive::round(noisy / self.step) * self.step } else { noisy }
    }
}

/// The mistake of a sensor whose scale does not exceed the noise and steps of the component that it reads: its residuals
/// would consist of noise.
pub(crate) fn scale_within_noise(
    (id, scale, unit): (&str, f64, Unit),
    (part, component, parameters): (&str, &Component, &[f64]),
) -> Option<Diagnostic> {
    let noise = Imperfection::of_component(component, parameters).deviation();
    if noise <= scale {
        return None;
    }
    let full_scale = (component.span)(parameters).map(|span| span.full_scale);
    // Three digits keep the magnitude readable.
    let noise = format!("{noise:.2e}").parse().unwrap_or(noise);
    let [scale, noise, full_scale] = [scale, noise, full_scale.unwrap_or_default()]
        .map(|value| NumberWithUnit(value, unit.symbol()).to_string());
    let message = format!(
        "the scale of sensor '{id}' is {scale}, less than noise and steps of '{part}': {noise}"
    );
    let help =
        format!("residuals are divided by it; usual is the full scale of the sensor, {full_scale}");
    Some(Diagnostic::new(message).with_help(help))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Study;

    #[test]
    fn what_sensors_show_has_the_deviation_that_is_declared_and_lies_on_steps() {
        let study = Study::default();
        let sensors = &study.measured[..study.base_sensors()];
        let of = |&sensor: &usize| Imperfection::of(&study.system, sensor);
        let imperfections: Vec<Imperfection> = sensors.iter().map(of).collect();
        const SAMPLES: usize = 20_000;
        let mut all = vec![0.0; SAMPLES * sensors.len()];
        let mut noise = NormalDeviates::new(5);
        for (value, own) in all.iter_mut().zip(imperfections.iter().cycle()) {
            *value = own.apply(*value, &mut noise);
        }
        for (place, own) in imperfections.iter().enumerate() {
            let shown = || all.iter().skip(place).step_by(sensors.len());
            let deviation = (shown().map(|v| v * v).sum::<f64>() / SAMPLES as f64).sqrt();
            assert!((deviation / own.deviation() - 1.0).abs() < 0.03, "{place}: {deviation}");
            assert!(own.step > 0.0 && shown().all(|v| (v / own.step).fract() == 0.0));
        }
    }
}
