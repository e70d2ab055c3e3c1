//! A checkpoint comes back as it was, and nothing else is taken for one.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod bar_world;

use bar_world::{examples, scenes};
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::ops::ControlFlow;
use std::sync::OnceLock;
use vmao_net::{Checkpoint, ContactNetwork, Device, Error, ModelKind, NetworkConfig, TrainingConfig, train};

fn checkpoint() -> &'static Checkpoint {
    static ONCE: OnceLock<Checkpoint> = OnceLock::new();
    ONCE.get_or_init(|| {
        let training = TrainingConfig { epochs: 1, ..TrainingConfig::small() };
        let examples = examples(&scenes(3, 10));
        train(ModelKind::Vmao, &NetworkConfig::small(), &training, &examples, 2, Device::Cpu, &mut |_| ControlFlow::Continue(()))
            .unwrap()
    })
}

/// The checkpoint's file with its tensors changed one by one; `None` leaves one out.
fn rewritten(change: impl Fn(&str, Vec<usize>, Vec<u8>) -> Option<(Dtype, Vec<usize>, Vec<u8>)>) -> Vec<u8> {
    let bytes = checkpoint().to_safetensors().unwrap();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let kept: Vec<_> = file
        .tensors()
        .into_iter()
        .filter_map(|(name, view)| change(&name, view.shape().to_vec(), view.data().to_vec()).map(|kept| (name, kept)))
        .collect();
    let views = kept.iter().map(|(name, (dtype, shape, data))| (name, TensorView::new(*dtype, shape.clone(), data).unwrap()));
    safetensors::serialize(views, None).unwrap()
}

#[track_caller]
fn refused(bytes: &[u8]) -> Error {
    Checkpoint::from_safetensors(bytes, &checkpoint().config_json().unwrap()).unwrap_err()
}

#[test]
fn it_comes_back_as_it_was_and_predicts_the_same() {
    let there = checkpoint();
    let bytes = there.to_safetensors().unwrap();
    let back = Checkpoint::from_safetensors(&bytes, &there.config_json().unwrap()).unwrap();
    assert_eq!(*there, back);
    assert_eq!(bytes, back.to_safetensors().unwrap());
    let scene = &scenes(8, 1)[0].example;
    let map = |checkpoint| ContactNetwork::load(checkpoint).map(&scene.points, &scene.colors, &[1.0, 0.0, -1.0]).unwrap();
    assert_eq!(map(there), map(&back));
}

#[test]
fn a_file_cut_short_or_garbled_is_refused() {
    let bytes = checkpoint().to_safetensors().unwrap();
    for cut in [0, 5, 100, bytes.len() - 1] {
        let error = refused(&bytes[..cut]);
        assert!(matches!(error, Error::NotSafetensors { bytes, .. } if bytes == cut), "{error}");
    }
    let mut garbled = bytes.clone();
    garbled[3] = 0xff;
    assert!(matches!(refused(&garbled), Error::NotSafetensors { .. }));
}

#[test]
fn a_wrong_shape_names_the_tensor_and_both_shapes() {
    let bytes = rewritten(|name, mut shape, data| {
        if name == "decoder.head.weight" {
            shape.reverse();
            shape[0] /= 2;
            shape[1] *= 2;
        }
        Some((Dtype::F32, shape, data))
    });
    let error = refused(&bytes).to_string();
    assert!(error.starts_with("tensor `decoder.head.weight` is F32 [") && error.contains("expected F32 ["), "{error}");
    let integers =
        rewritten(|name, shape, data| Some((if name == "decoder.logits.bias" { Dtype::I32 } else { Dtype::F32 }, shape, data)));
    assert_eq!(refused(&integers).to_string(), "tensor `decoder.logits.bias` is I32 [2]; expected F32 [2]");
}

#[test]
fn a_missing_and_a_foreign_tensor_are_named() {
    let missing = rewritten(|name, shape, data| (name != "posterior.mean.bias").then_some((Dtype::F32, shape, data)));
    let error = refused(&missing).to_string();
    assert!(error.starts_with("the checkpoint has no tensor `posterior.mean.bias`; it has: decoder.context.bias, "), "{error}");
    let config = checkpoint().config_json().unwrap().replace("\"vmao\"", "\"top1\"");
    let as_top1 = Checkpoint::from_safetensors(&checkpoint().to_safetensors().unwrap(), &config).unwrap_err().to_string();
    assert!(as_top1.starts_with("tensor `decoder.up_conv.0.mlp.0.weight` is F32 ["), "{as_top1}");
}

#[test]
fn a_value_that_is_no_number_is_named_with_its_place() {
    let put = |tensor: &'static str, value: f32| {
        rewritten(move |name, shape, mut data| {
            if name == tensor {
                data[8..12].copy_from_slice(&value.to_le_bytes());
            }
            Some((Dtype::F32, shape, data))
        })
    };
    let error = refused(&put("scene.abstraction.1.mlp.0.weight", f32::NAN)).to_string();
    assert_eq!(error, "tensor `scene.abstraction.1.mlp.0.weight` holds NaN at element 2; expected finite values");
    let error = refused(&put("decoder.head.norm.running_var", -1.0)).to_string();
    assert!(error.ends_with("holds -1 at element 2; expected finite values of zero or more"), "{error}");
}

#[test]
fn a_configuration_that_is_not_ours_is_refused() {
    let bytes = checkpoint().to_safetensors().unwrap();
    let config = checkpoint().config_json().unwrap();
    let with =
        |from: &str, to: &str| Checkpoint::from_safetensors(&bytes, &config.replacen(from, to, 1)).unwrap_err().to_string();
    assert!(with("{", "").starts_with("the checkpoint's configuration cannot be read: "));
    assert!(with("\"kind\"", "\"sort\"").contains("unknown field `sort`"));
    assert_eq!(with("\"format\": 1", "\"format\": 2"), "format is 2; it must be 1");
    assert!(with("\"latent_size\": 3", "\"latent_size\": 0").starts_with("latent_size is 0"));
}
